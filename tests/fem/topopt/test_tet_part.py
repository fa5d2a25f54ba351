from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.check import check_mesh
from ccfem.fem.elasticity import Force, PointForce, Problem, Support, solve
from ccfem.fem.materials import isotropic, transversely_isotropic
from ccfem.fem.topopt import Design, Simp, as_problem, part as cut_module, part_shape
from ccfem.fem.topopt.part import cut_mesh, relaxed, volume_above

PLA = isotropic(3000.0, 0.35)
BOX = box_mesh((20.0, 20.0, 20.0), (16, 16, 16), alternating=True)
CENTRED = BOX.points - 10.0


def euler(triangles):
    """Characteristic of every shell of a surface, after checking that it is a closed manifold."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    assert (count == 2).all()
    # Round every node its triangles form one ring.
    n = triangles.max() + 1
    corner = np.arange(triangles.size)
    links = []
    for first in range(3):
        for other in (1, 2):
            at = (first + other) % 3
            key = triangles[:, first] * n + triangles[:, at]
            links.append(np.stack([key, 3 * np.arange(len(triangles)) + first], axis=1))
    keys, corners = np.concatenate(links).T
    order = np.argsort(keys, kind="stable")
    pairs = corners[order].reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=2 * (len(corner),))
    rings, _ = connected_components(graph, directed=False)
    assert rings == len(np.unique(triangles))
    _, label = connected_components(
        coo_array((np.ones(len(edges)), edges.T), shape=(n, n)), directed=False
    )
    found = []
    for shell in np.unique(label[triangles[:, 0]]):
        faces = (label[triangles[:, 0]] == shell).sum()
        found.append(int((label == shell).sum() - (label[edges[:, 0]] == shell).sum() + faces))
    return sorted(found)


def torus(middle):
    x, y, _ = CENTRED.T
    z = BOX.points[:, 2] - middle
    return 3.0 - np.hypot(np.hypot(x, y) - 6.0, z)


@pytest.mark.parametrize(
    ("values", "volume", "wanted"),
    [
        (8.0 - np.linalg.norm(CENTRED, axis=1), 4 / 3 * np.pi * 8.0**3, [2]),
        (8.0 - np.linalg.norm(BOX.points, axis=1), np.pi / 6 * 8.0**3, [2]),
        (torus(10.0), 2 * np.pi**2 * 6.0 * 3.0**2, [0]),
        (torus(0.0), np.pi**2 * 6.0 * 3.0**2, [0]),
        (np.abs(np.linalg.norm(CENTRED, axis=1) - 6.0) * -1.0 + 2.0, 4 / 3 * np.pi * 448, [2, 2]),
    ],
)
def test_solids_of_the_textbook(values, volume, wanted):
    # Ball, octant of one, torus of genus 1, half a torus on its flat side, hollow ball.
    found = cut_mesh(BOX, values, 0.0)
    for mesh in (found.mesh, relaxed(found)):
        assert euler(mesh.boundary) == wanted
        assert mesh.volumes.min() > 0.0
        assert mesh.volumes.sum() == pytest.approx(volume, rel=0.04)
        # The cells fill their surface: no gap, no overlap.
        assert Surface(mesh.points, mesh.boundary).volume == pytest.approx(mesh.volumes.sum())
        assert not check_mesh(mesh)[1].findings


def test_random_fields_leave_sound_meshes():
    values = np.random.default_rng(0).normal(size=len(BOX.points))
    mesh = cut_mesh(BOX, values, 0.3).mesh
    euler(mesh.boundary)
    assert mesh.volumes.min() > 0.0
    assert Surface(mesh.points, mesh.boundary).volume == pytest.approx(mesh.volumes.sum())


def test_volume_above_is_that_of_the_cut(monkeypatch):
    plane = BOX.points @ [0.3, -0.5, 0.8]
    # A plane through the centre halves the box.
    assert volume_above(BOX, plane, float(plane.mean())) == pytest.approx(4000.0, rel=1e-9)
    monkeypatch.setattr(cut_module, "_LEAST", 1e-9)
    values = np.random.default_rng(1).normal(size=len(BOX.points))
    for level in (-1.0, 0.0, 0.7):
        wanted = cut_mesh(BOX, values, level).mesh.volumes.sum()
        assert volume_above(BOX, values, level) == pytest.approx(wanted, rel=1e-6)


def test_smoothing_takes_bumps_off_and_keeps_flat_sides_and_patches():
    rng = np.random.default_rng(2)
    values = 12.0 - np.linalg.norm(BOX.points - [0.0, 10.0, 10.0], axis=1)
    rough = cut_mesh(BOX, values + rng.uniform(-0.4, 0.4, len(values)), 0.0)
    smooth = relaxed(rough)
    # However often it is smoothed, nothing grows.
    area = [mesh.facet_areas(mesh.boundary)[0].sum() for mesh in (rough.mesh, relaxed(rough, 100))]
    assert area[1] < area[0]
    free = np.setdiff1d(rough.mesh.boundary[rough.facet < 0], rough.mesh.boundary[rough.facet >= 0])
    before, after = (
        np.std(np.linalg.norm(mesh.points[free] - [0.0, 10.0, 10.0], axis=1))
        for mesh in (rough.mesh, smooth)
    )
    assert after < 0.75 * before
    for name, axis, at in (("x_min", 0, 0.0), ("y_min", 1, 0.0), ("z_max", 2, 20.0)):
        np.testing.assert_allclose(smooth.points[smooth.patch(name)][..., axis], at, atol=1e-12)


@pytest.fixture(scope="module")
def cantilever():
    mesh = box_mesh((24.0, 8.0, 12.0), (15, 5, 8), alternating=True)
    centre = mesh.points[mesh.boundary].mean(axis=1)
    tip = mesh.boundary[(centre[:, 0] > 24.0 - 1e-9) & (centre[:, 2] < 4.0)]
    loads = {
        "down": (Force("tip", (0.0, 0.0, -100.0)),),
        "side": (Force("tip", (0.0, 40.0, 0.0)),),
    }
    patched = mesh.with_patches({"tip": tip})
    problem = Problem(patched, PLA, (Support("x_min"),), loads, order=1)
    return Simp(0.35, radius=2.6, max_iterations=30)(problem)


def test_a_design_becomes_a_closed_part(cantilever):
    surface = part_shape(cantilever)
    assert surface.volume == pytest.approx(0.35 * 24 * 8 * 12, rel=0.03)
    assert all(each <= 2 and each % 2 == 0 for each in euler(surface.triangles))
    assert surface.points.min() >= -1e-9
    assert (surface.points.max(axis=0) <= np.array([24.0, 8.0, 12.0]) + 1e-9).all()
    assert part_shape(cantilever, 0.45).volume == pytest.approx(0.45 * 24 * 8 * 12, rel=0.03)
    assert (
        part_shape(cantilever, threshold=0.3).volume > part_shape(cantilever, threshold=0.6).volume
    )


def test_the_part_is_a_problem_as_stiff_as_the_design(cantilever):
    part = as_problem(cantilever, PLA)
    fields = solve(part)
    filled = np.where(cantilever.filled(), 1.0, 1e-6)
    cut = solve(replace(cantilever.full, density=filled), backend="superlu")
    grey = solve(cantilever.problem, backend="superlu")
    for case, field in fields.items():
        # As the densest cells of the same volume, and stiffer than the penalised grey.
        assert field.strain_energy == pytest.approx(cut[case].strain_energy, rel=0.15)
        assert field.strain_energy < grey[case].strain_energy
    tip = part.mesh.patch("tip")
    np.testing.assert_allclose(part.mesh.points[tip][..., 0], 24.0)
    assert part.mesh.points[tip][..., 2].max() <= 4.5 + 1e-9
    # Its share of the patch is filled: a load needs the material there.
    assert part.mesh.facet_areas(tip)[0].sum() > 0.6 * 8.0 * 4.5


def made_up(density, mesh=BOX, point=(20.0, 10.0, 10.0), angle=None):
    loads = {"pull": (PointForce(point, (1.0, 0.0, 0.0)),)}
    problem = Problem(mesh, PLA, (Support("x_min"),), loads)
    m = len(mesh.cells)
    return Design(problem, density, density, np.ones(m), np.ones(1), np.zeros(0), "", angle)


def test_a_design_in_pieces_is_refused_with_the_cure():
    x = BOX.points[BOX.cells].mean(axis=1)[:, 0]
    apart = made_up(np.where(np.abs(x - 10.0) < 3.0, 0.0, 1.0))
    for options in ({}, {"threshold": 0.5}):
        with pytest.raises(InputError, match=r"falls apart .* raise the volume fraction"):
            part_shape(apart, **options)
    # Cells between the ends may come yet where the iterations ran out.
    stopped = replace(apart, compliance=np.ones(4), change=np.ones(3))
    with pytest.raises(InputError, match=r"not converged \(iterations: 3\) .* \(--iter"):
        part_shape(stopped)
    with pytest.raises(InputError, match=r"^the design falls apart"):
        part_shape(replace(stopped, converged="change"))
    # The piece without load is left out where the rest holds together.
    held = made_up(np.where(np.abs(x - 10.0) < 3.0, 0.0, 1.0), point=(0.0, 10.0, 10.0))
    assert part_shape(held, threshold=0.5).points[:, 0].max() < 8.5


def test_small_voids_are_filled_and_large_ones_stay():
    centre = BOX.points[BOX.cells].mean(axis=1)
    # All cells round one node, whose density is zero therefore.
    node = np.linalg.norm(BOX.points - [6.25, 5.0, 5.0], axis=1).argmin()
    small = (BOX.cells == node).any(axis=1)
    large = np.linalg.norm(centre - [12.0, 12.0, 10.0], axis=1) < 5.0
    surface = part_shape(made_up(np.where(small | large, 0.0, 1.0)), threshold=0.5)
    assert euler(surface.triangles) == [2, 2]
    assert 8000.0 - surface.volume == pytest.approx(4 / 3 * np.pi * 125.0, rel=0.2)


def test_axes_follow_the_angles():
    fibre = transversely_isotropic(50000.0, 4000.0, 0.3, 2500.0)
    angle = np.full(len(BOX.cells), 0.3)
    density = 1.0 - BOX.points[BOX.cells].mean(axis=1)[:, 2] / 40.0
    part = as_problem(made_up(density, angle=angle), fibre, volume_fraction=0.9)
    wanted = [np.cos(0.3), np.sin(0.3), 0.0]
    np.testing.assert_allclose(part.axes[:, :, 0], np.broadcast_to(wanted, (len(part.axes), 3)))
    assert part.mesh.points[:, 2].max() == pytest.approx(18.0, abs=0.1)


def test_options_of_plates_are_refused():
    with pytest.raises(InputError, match="thickness, edge_length: for plates only"):
        as_problem(made_up(np.ones(len(BOX.cells))), PLA, 2.0, 1.0)
    with pytest.raises(InputError, match=r"volume_fraction must be above 0 and at most 1; got 1.5"):
        part_shape(made_up(np.ones(len(BOX.cells))), 1.5)
    with pytest.raises(InputError, match=r"threshold must be above 0 and below 1; got 1.0"):
        part_shape(made_up(np.ones(len(BOX.cells))), threshold=1.0)
