"""Decks of hexahedra with local axes, couplings and ties, beside beam theory and Lame's tube."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.cases.reading import read
from ccfem.fem.elasticity import Force, LocalSupport, Moment, RigidPatch, Support, TiedPatch, solve

LENGTH, WIDTH, MODULUS = 10.0, 2.0, 1000.0
INERTIA, MOMENT = WIDTH**4 / 12.0, 50.0
SIDES = [[0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3], [1, 2, 3, 0, 5, 6, 7, 4, 4, 5, 6, 7]]
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
HELD = "*BOUNDARY\nfoot, 1, 3\n"


def grid_cells(counts):
    """Nodes of 20 of the cells of a grid: twice its steps along x, y and z as places."""
    places = {}
    cells = []
    for start in np.ndindex(*counts):
        corners = 2 * (np.array(start) + CORNERS)
        nodes = np.concatenate([corners, corners[SIDES].mean(axis=0).astype(int)])
        cells.append([places.setdefault(tuple(p), len(places) + 1) for p in nodes.tolist()])
    return np.array(list(places)), np.array(cells)


def listed(labels):
    return "".join(f"{label},\n" for label in labels)


def deck(points, cells, poisson=0.0, first=0, sets=None):
    """Mesh and material; labels start after `first`."""
    text = "*NODE, NSET=Nall\n"
    text += "".join(f"{k}, {x!r}, {y!r}, {z!r}\n" for k, (x, y, z) in enumerate(points, first + 1))
    text += "*ELEMENT, TYPE=C3D20R, ELSET=Eall\n"
    for k, cell in enumerate(cells.tolist(), first + 1):
        words = [str(k), *(str(node + first) for node in cell)]
        text += ", ".join(words[:11]) + ",\n" + ", ".join(words[11:]) + "\n"
    for name, chosen in (sets or {}).items():
        text += f"*NSET, NSET={name}\n{listed(np.flatnonzero(chosen) + first + 1)}"
    return text


def material(poisson=0.0):
    text = f"*MATERIAL, NAME=M\n*ELASTIC\n{MODULUS}, {poisson}\n"
    return text + "*SOLID SECTION, ELSET=Eall, MATERIAL=M\n"


def bar(counts=(4, 1, 1), start=0.0, length=LENGTH, first=0):
    """A bar along x with sets foot and tip, and surfaces of elements at both ends."""
    places, cells = grid_cells(counts)
    points = places / (2.0 * np.array(counts)) * [length, WIDTH, WIDTH] + [start, 0.0, 0.0]
    x = points[:, 0]
    sets = {f"foot{first or ''}": x == start, f"tip{first or ''}": x == start + length}
    text = deck(points.tolist(), cells, first=first, sets=sets)
    # Faces 6 and 4 are those of x and of 1 - x in the first and the last cell along x.
    layer = counts[1] * counts[2]
    for name, at, face in (
        ("near", range(layer), 6),
        ("far", range(len(cells) - layer, len(cells)), 4),
    ):
        text += f"*SURFACE, NAME={name}{first or ''}, TYPE=ELEMENT\n"
        text += "".join(f"{k + first + 1}, S{face}\n" for k in at)
    return text, points.tolist()


def step(text):
    return f"*STEP\n*STATIC\n{text}*END STEP\n"


def solved(tmp_path, text):
    (tmp_path / "deck.inp").write_text(text)
    with pytest.warns(UserWarning, match="hexahedra are split"):
        case = read(tmp_path / "deck.inp")
    (field,) = solve(case.problem).values()
    return case, field


def tip(field):
    return field.displacement[np.isclose(field.mesh.points[:, 0], LENGTH)]


def reference(x, y=0.5 * WIDTH, z=0.5 * WIDTH):
    return f"*NODE\n900, {x}, {y}, {z}\n"


def coupled(kind, x=LENGTH, **places):
    text = reference(x, **places) + "*COUPLING, CONSTRAINT NAME=C, REF NODE=900, SURFACE=far\n"
    return text + f"*{kind}\n1, 3\n"


def test_pressure_on_the_faces_of_hexahedra(tmp_path):
    text = bar((2, 2, 1))[0] + material() + HELD + step("*DSLOAD\nfar, P, -2.\n")
    case, field = solved(tmp_path, text)
    assert tip(field)[:, 0] == pytest.approx(2.0 * LENGTH / MODULUS, rel=1e-9)
    assert case.problem.supports == (Support("foot"),)
    np.testing.assert_allclose(field.stress[:, 0, 0], 2.0, rtol=1e-8)
    last = step("*DLOAD\n3, P4, -2.\n4, P4, -2.\n")
    _, again = solved(tmp_path, bar((2, 2, 1))[0] + material() + HELD + last)
    np.testing.assert_allclose(again.displacement, field.displacement, atol=1e-12)


@pytest.mark.parametrize("kind", ["DISTRIBUTING", "KINEMATIC"])
def test_a_moment_at_a_reference_node_bends_as_a_beam(tmp_path, kind):
    text = bar()[0] + material() + coupled(kind) + HELD + step(f"*CLOAD\n900, 5, {MOMENT}\n")
    case, field = solved(tmp_path, text)
    assert case.problem.loads["step_1"] == (Moment("far", (0.0, MOMENT, 0.0)),)
    # Pure bending, nu = 0: w = -M x^2 / (2 E I), exact for quadratic cells.
    assert tip(field)[:, 2].mean() == pytest.approx(
        -MOMENT * LENGTH**2 / (2 * MODULUS * INERTIA), rel=1e-6
    )
    turned = field.support_forces
    assert np.abs(list(turned.values())).max() < 1e-6


def test_a_force_off_the_axis_twists_and_bends_alike_by_both_couplings(tmp_path):
    # A pull of 3 N along x with an arm of 5 mm along z: a moment of 15 N mm about y.
    results = []
    for kind in ("DISTRIBUTING", "KINEMATIC"):
        text = bar()[0] + material() + coupled(kind, x=LENGTH + 4.0, z=0.5 * WIDTH + 5.0)
        case, field = solved(tmp_path, text + HELD + step("*CLOAD\n900, 1, 3.\n"))
        force, moment = case.problem.loads["step_1"]
        assert force == Force("far", (3.0, 0.0, 0.0))
        np.testing.assert_allclose(moment.vector, [0.0, 15.0, 0.0], atol=1e-9)
        results.append(tip(field))
    stretch, bend = 3.0 * LENGTH / (MODULUS * WIDTH**2), -15.0 * LENGTH**2 / (2 * MODULUS * INERTIA)
    for result in results:
        np.testing.assert_allclose(result[:, [0, 2]].mean(axis=0), [stretch, bend], rtol=1e-6)


def test_a_held_reference_node_holds_its_faces(tmp_path):
    near = reference(0.0).replace("900", "901") + "*COUPLING, CONSTRAINT NAME=B, REF NODE=901, "
    near += "SURFACE=near\n*KINEMATIC\n1, 3\n"
    text = bar()[0] + material() + near + "*BOUNDARY\n901, 1, 6\n" + step("*DSLOAD\nfar, P, -2.\n")
    case, field = solved(tmp_path, text)
    assert case.problem.supports == (Support("near"),)
    assert tip(field)[:, 0] == pytest.approx(2.0 * LENGTH / MODULUS, rel=1e-9)
    # A rotation that is given bends it: the moment is E I angle / length.
    angle = 0.01
    ends = near + "*BOUNDARY\n901, 1, 6\n" + coupled("KINEMATIC")
    text = bar()[0] + material() + ends + step(f"*BOUNDARY\n900, 5, 5, {angle}\n900, 4\n900, 6\n")
    case, field = solved(tmp_path, text)
    rigid = next(s for s in case.problem.all_supports if isinstance(s, RigidPatch))
    assert (rigid.components, rigid.rotations) == ("", "xyz")
    assert rigid.angle[1] == pytest.approx(np.degrees(angle))
    assert tip(field)[:, 2].mean() == pytest.approx(-angle * LENGTH / 2, rel=1e-6)


def test_single_components_of_a_held_reference_node(tmp_path):
    """The tip slides on a plane that is pushed in: the bar is compressed, and free to widen."""
    guide = coupled("KINEMATIC").replace("1, 3", "1, 1")
    text = bar()[0] + material(0.3) + guide
    text += "*BOUNDARY\nfoot, 1, 1\n1, 1, 3\n4, 3, 3\n"
    text += step("*BOUNDARY\n900, 1, 1, -0.1\n900, 2, 6\n")
    case, field = solved(tmp_path, text)
    np.testing.assert_allclose(field.stress[:, 0, 0], -0.1 * MODULUS / LENGTH, rtol=1e-6)
    assert Support("far", "x", (-0.1, 0.0, 0.0)) in case.problem.supports


def test_a_rigid_body_with_a_node_of_rotations(tmp_path):
    body = (
        reference(LENGTH)
        + f"901, {LENGTH}, 0., 0.\n*RIGID BODY, NSET=tip, REF NODE=900, ROT NODE=901\n"
    )
    text = bar()[0] + material() + body + HELD + step(f"*CLOAD\n901, 2, {MOMENT}\n")
    _, field = solved(tmp_path, text)
    assert tip(field)[:, 2].mean() == pytest.approx(
        -MOMENT * LENGTH**2 / (2 * MODULUS * INERTIA), rel=1e-6
    )


def tube(counts=(3, 4, 1)):
    """Mesh of a quarter of a tube of radii 1 and 2, 0.5 mm thick."""
    places, cells = grid_cells(counts)
    share = places / (2.0 * np.array(counts))
    radius, angle = 1.0 + share[:, 0], 0.5 * np.pi * share[:, 1]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.5 * share[:, 2]])
    sets = {"inner": share[:, 0] == 0.0, "cuts": np.isin(share[:, 1], [0.0, 1.0])}
    sets["flats"] = np.isin(share[:, 2], [0.0, 1.0])
    return deck(points.tolist(), cells, sets=sets)


def test_a_tube_held_along_cylindrical_axes(tmp_path):
    text = tube()
    text += material(0.3) + "*TRANSFORM, NSET=Nall, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    text += "*BOUNDARY\nflats, 3\ncuts, 2\n" + step("*BOUNDARY\ninner, 1, 1, 0.01\n")
    case, field = solved(tmp_path, text)
    assert all(isinstance(s, LocalSupport) for s in case.problem.all_supports)
    # Lame, plane strain, free outside: u = a r + b / r with a (1 - 2 nu)^-1 = b / 2^2.
    a = 0.01 / (1.0 + 4.0 / 0.4)
    b = 0.01 - a
    x, y, z = field.mesh.points.T
    radius = np.hypot(x, y)
    radial = (field.displacement[:, 0] * x + field.displacement[:, 1] * y) / radius
    assert np.abs(field.displacement[np.isin(z, [0.0, 0.5]), 2]).max() < 1e-12
    # The centres of faces inside are off by less than a per cent on cells of 22.5 degrees.
    np.testing.assert_allclose(radial, a * radius + b / radius, rtol=5e-3)


def test_forces_and_supports_along_turned_axes(tmp_path):
    text, _ = bar()
    turned = "*TRANSFORM, NSET=Nall, TYPE=R\n0., 1., 0., -1., 0., 0.\n"
    # Component 1 of the nodes is y, and 2 is -x.
    text += material() + turned + "*BOUNDARY\nfoot, 1, 3\n"
    case, field = solved(tmp_path, text + step("*CLOAD\ntip, 2, -1.\n"))
    (load,) = case.problem.loads["step_1"]
    np.testing.assert_allclose(load.vectors, np.tile([1.0, 0.0, 0.0], (8, 1)), atol=1e-12)
    assert field.support_forces["foot"] == pytest.approx([-8.0, 0.0, 0.0], abs=1e-6)


def test_heat_reaches_the_middles_of_diagonals(tmp_path):
    text, points = bar()
    text += material() + "*EXPANSION\n1e-3\n" + HELD.replace("foot, 1, 3", "foot, 1\n1, 2, 3\n4, 3")
    text = text.replace("*SOLID SECTION", "*SOLID SECTION", 1)
    warm = "".join(f"{k}, {3.0 * x!r}\n" for k, (x, _, _) in enumerate(points, 1))
    text = text.replace("*EXPANSION\n1e-3\n", "")
    text = text.replace("*SOLID SECTION,", "*EXPANSION\n1e-3\n*SOLID SECTION,")
    text += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 0.\n" + step(f"*TEMPERATURE\n{warm}")
    _, field = solved(tmp_path, text)
    # Free: alpha times the integral of 3 x over the length, on the axis and off it alike.
    assert tip(field)[:, 0].mean() == pytest.approx(1e-3 * 1.5 * LENGTH**2, rel=0.02)


def test_tied_bars_are_one(tmp_path):
    first, _ = bar((2, 1, 1), length=0.5 * LENGTH)
    second, _ = bar((2, 1, 1), start=0.5 * LENGTH, length=0.5 * LENGTH, first=500)
    tie = "*TIE, NAME=T\nnear500, far\n"
    text = first + second + material() + tie + HELD
    text += step("*DSLOAD\nfar500, TRVEC, 1., 0., 0., 1.\n")
    case, field = solved(tmp_path, text)
    assert any("*TIE glues 8 coinciding nodes" in line for line in case.findings)
    whole = bar()[0] + material() + HELD + step("*DSLOAD\nfar, TRVEC, 1., 0., 0., 1.\n")
    _, wanted = solved(tmp_path, whole)
    assert tip(field)[:, 2].mean() == pytest.approx(tip(wanted)[:, 2].mean(), rel=2e-3)


def test_tied_bars_of_unlike_meshes_are_one(tmp_path):
    first, _ = bar((2, 1, 1), length=0.5 * LENGTH)
    second, _ = bar((3, 2, 2), start=0.5 * LENGTH, length=0.5 * LENGTH, first=500)
    tie = "*TIE, NAME=T, POSITION TOLERANCE=0.01\nnear500, far\n"
    text = first + second + material() + tie + HELD
    text += step("*DSLOAD\nfar500, TRVEC, 1., 0., 0., 1.\n")
    case, field = solved(tmp_path, text)
    assert any(
        "25 of 25 nodes of 'near500' follow the faces of 'far'" in line for line in case.findings
    )
    assert TiedPatch("near500", "far", 0.01) in case.problem.supports
    whole = bar()[0] + material() + HELD + step("*DSLOAD\nfar, TRVEC, 1., 0., 0., 1.\n")
    _, wanted = solved(tmp_path, whole)
    assert tip(field)[:, 2].mean() == pytest.approx(tip(wanted)[:, 2].mean(), rel=0.01)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*COUPLING, CONSTRAINT NAME=C, REF NODE=900, SURFACE=far\n", "needs .KINEMATIC or"),
        (coupled("KINEMATIC").replace("1, 3", "3, 3"), "follow .* that is free in 4, 5, 3,"),
        (coupled("KINEMATIC").replace("1, 3", "4, 4"), "have degrees of freedom 1 to 3; got .4."),
        (coupled("KINEMATIC").replace("SURFACE=far", "SURFACE=no"), "no surface 'no'"),
        (coupled("DISTRIBUTING, WEIGHTING METHOD=LINEAR"), "weights other than uniform"),
        (coupled("KINEMATIC").replace("NODE=900", "NODE=1"), "belongs to a solid"),
        ("*KINEMATIC\n1, 3\n", "stands below no .COUPLING"),
        ("*TRANSFORM, NSET=Nall, TYPE=S\n0, 0, 0, 0, 0, 1\n", "TYPE=S is not followed"),
        ("*RIGID BODY, ANALYTICAL SURFACE=R, REF NODE=900\n", "ANALYTICALSURFACE is not followed"),
        ("*NSET, NSET=two\n1, 2\n*RIGID BODY, NSET=two, REF NODE=900\n", "2 nodes of 'two' do not"),
        ("*TIE, NAME=T\nnear, far\n", "no node of 'near' lies within .* the nearest is 10 mm away"),
        (coupled("DISTRIBUTING") + "*BOUNDARY\n900, 1\n", "passes loads on, and its reference"),
    ],
)
def test_constraints_without_means_are_named(tmp_path, text, message):
    nodes = "" if "*NODE" in text else reference(LENGTH)
    whole = bar()[0] + material() + nodes + text + HELD + step("*DSLOAD\nfar, P, 1.\n")
    (tmp_path / "deck.inp").write_text(whole)
    with (
        pytest.warns(UserWarning, match="split"),
        pytest.raises(InputError, match=message) as caught,
    ):
        read(tmp_path / "deck.inp")
    assert "line " in str(caught.value)
