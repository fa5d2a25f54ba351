"""Good files of every format that ccfem reads, and mutants of them; the same for the same seed."""

import random
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ccfem.body.files import write_mesh
from ccfem.body.mesh import box_mesh

__all__ = ["MESH", "SIZES", "frd", "good_files", "mutants", "part_of_sizes"]

MESH = box_mesh((20.0, 10.0, 5.0), (4, 2, 1))
"""What the good files hold, and stress and paths are on."""

PART = """name = "box"
mesh = "box.npz"
material = "pla"
layers = 3
[patches.foot]
rule = "plane"
normal = "x"
offset = "min"
[patches.pin]
rule = "cylinder"
point = [15, 10, 0]
axis = "z"
radius = 50.0
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "x_max"
vector = [10, 0, 0]
[machine]
minimum_length = 45.0
"""
SIZES = """name = "sizes"
mesh = "box.npz"
order = 1
[material]
modulus = 3500.0
poisson = 0.35
tensile_strength = 50.0
mass_density = 1.24
expansion = 7e-5
[patches.foot]
rule = "plane"
normal = "x"
offset = "min"
[[supports]]
kind = "spring"
patch = "foot"
stiffness = [2000.0, 2000.0, 2000.0]
[[supports]]
patch = "y_min"
components = "y"
value = [0.0, 0.01, 0.0]
[[loads.pull]]
kind = "force"
patch = "x_max"
vector = [10.0, 0, 0]
[[loads.pull]]
kind = "pressure"
patch = "z_max"
magnitude = 0.1
[[loads.pull]]
kind = "gravity"
"""
"""A part file in which every size of a material, a support and a load stands."""

NUMBERS = (
    *("0", "-1", "1e308", "-1e308", "nan", "inf", "-inf", "1e-320", "4294967296", "2147483647"),
    *("1000000000", "99999999999999999999", "9" * 400, "0x10", "1.5", "''", "[]", "1e6"),
)


def good_files(folder: Path) -> list[Path]:
    """Write one good file of each format."""
    import pyvista

    mesh = MESH
    for name in ("box.npz", "box.tet", "box.vtu"):
        write_mesh(mesh, folder / name)
    used, triangles = np.unique(mesh.boundary, return_inverse=True)
    shell = pyvista.PolyData.from_regular_faces(mesh.points[used], triangles.reshape(-1, 3))
    for name, binary in (
        *(("box.stl", True), ("text.stl", False), ("box.ply", True), ("text.ply", False)),
    ):
        shell.save(folder / name, binary=binary)
    grid = pyvista.UnstructuredGrid({10: mesh.cells}, np.array(mesh.points))
    grid.save(folder / "text.vtu", binary=False)
    rows = [f"v {x} {y} {z}" for x, y, z in shell.points.tolist()]
    rows += ["f " + " ".join(str(k + 1) for k in t) for t in triangles.reshape(-1, 3).tolist()]
    (folder / "box.obj").write_text("\n".join(rows) + "\n")
    (folder / "box.inp").write_text(_deck(mesh))
    (folder / "scopes.inp").write_text(_assembly(mesh))
    (folder / "analysis.inp").write_text(_analysis())
    bricks = pyvista.ImageData(dimensions=(5, 3, 2), spacing=(5.0, 5.0, 5.0))
    bricks = bricks.cast_to_unstructured_grid()  # voxels
    bricks.save(folder / "bricks.vtu", binary=False)
    (folder / "stress.xdmf").write_text(_xdmf(mesh))
    (folder / "box.msh").write_text(_msh(mesh))
    with zipfile.ZipFile(folder / "box.3mf", "w") as archive:
        archive.writestr("_rels/.rels", '<Relationship Target="/a.model" Type="a/3dmodel"/>')
        archive.writestr("a.model", _model(shell.points.tolist(), triangles.reshape(-1, 3)))
    (folder / "box.unv").write_text(unv(mesh))
    (folder / "box.bdf").write_text(bdf(mesh))
    (folder / "box.mesh").write_text(medit(mesh))
    grid.save(folder / "box.vtk", binary=False)
    (folder / "part.toml").write_text(PART)
    (folder / "stress.frd").write_text(frd(mesh, np.tile((1.5, -2, 0.5, 0.01, 0, 3), (30, 1))))
    rows = ["element;Sxx [MPa];Syy [MPa];Szz [MPa];Syz [MPa];Sxz [MPa];Sxy [MPa]"]
    rows += [f"{k};1.5;-2.0;0.5;1e-3;0;{k}.25" for k in range(1, len(mesh.cells) + 1)]
    (folder / "stress.csv").write_text("\n".join(rows) + "\n")
    grid.cell_data["stress"] = np.ones((len(mesh.cells), 9))
    grid.field_data["unit of stress"] = np.frombuffer(b"MPa", dtype=np.uint8)
    grid.save(folder / "stress.vtu", binary=False)
    grid.cell_data.clear()
    grid.field_data.clear()
    for name in ("xx", "yy", "zz", "xy", "xz", "yz"):
        grid.point_data[f"Stress {name} component"] = 1e6 * mesh.points[:, 0]
    grid.save(folder / "stress.vtk", binary=False)
    rows = [f"{x},{y},2.5,{y},0" for y in range(1, 9) for x in range(2, 19, 4)]
    (folder / "paths.csv").write_text("\n".join(["x,y,z,path,layer", *rows]) + "\n")
    rows = [f"S\nX2.0 Y{y}.0 Z2.5\nX18.0 Y{y}.5 Z2.5\nE" for y in range(1, 9)]
    (folder / "paths.txt").write_text("\n".join([";Layer_CCF: 0", *rows]) + "\n")
    return sorted(folder.iterdir())


def part_of_sizes(chance: random.Random) -> tuple[str, float]:
    """`SIZES` with one of its sizes times a factor over 12 decades, and the factor."""
    import re

    sizes = [each for each in re.finditer(r"\d+\.?\d*(e-\d+)?(?=[,\n])", SIZES)
             if float(each[0]) not in (0.0, 1.0, 0.35)]  # fmt: skip
    chosen = chance.choice(sizes)
    factor = 10.0 ** chance.uniform(-6.0, 6.0)
    value = f"{float(chosen[0]) * factor:.6g}"
    return SIZES[: chosen.start()] + value + SIZES[chosen.end() :], factor


def _deck(mesh) -> str:
    """Abaqus deck with nested sets, a generated one, and a surface."""
    lines = ["*NODE"]
    lines += [f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(mesh.points.tolist(), 1)]
    lines += ["*ELEMENT, TYPE=C3D4, ELSET=ALL"]
    lines += [f"{k}, " + ", ".join(str(n + 1) for n in c) for k, c in enumerate(mesh.cells, 1)]
    foot = np.flatnonzero(mesh.points[:, 0] == 0.0) + 1
    lines += ["*NSET, NSET=FOOT", ", ".join(map(str, foot[:8])), "*NSET, NSET=OUTER", "FOOT"]
    lines += ["*NSET, NSET=SOME, GENERATE", "1, 12, 2", "*ELSET, ELSET=FIRST", "1, 2, 3"]
    lines += ["*SURFACE, NAME=SKIN", "FIRST, S1", "ALL, S2"]
    return "\n".join(lines) + "\n"


def _assembly(mesh) -> str:
    """Abaqus deck of two instances of a part, one of them turned, with sets in every scope."""
    lines = ["*PART, NAME=BOX", *_deck(mesh).splitlines(), "*END PART", "*ASSEMBLY, NAME=A"]
    lines += ["*INSTANCE, NAME=B-1, PART=BOX", "*END INSTANCE", "*INSTANCE, NAME=B-2, PART=BOX"]
    lines += ["50., 0., 0.", "50., 0., 0., 50., 0., 1., 90.", "*END INSTANCE"]
    lines += ["*NSET, NSET=FOOT, INSTANCE=B-2", "FOOT", "*NSET, NSET=BOTH", "B-1.FOOT, FOOT, B-2.3"]
    lines += ["*SURFACE, NAME=SKIN", "B-2.FIRST, S1", "*SURFACE, TYPE=NODE, NAME=END", "B-1.FOOT"]
    return "\n".join([*lines, "*END ASSEMBLY"]) + "\n"


def _analysis() -> str:
    """Deck of tied hexahedra and a wedge, with axes of a cylinder, couplings, and heat."""
    block = [(x, y, z) for z in (0, 5) for x, y in ((0, 0), (5, 0), (5, 5), (0, 5))]
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(block, 1)]
    lines += [f"{k}, {x + 5}, {y}, {z}" for k, (x, y, z) in enumerate(block, 11)]
    lines += ["21, 15, 0, 0", "22, 15, 0, 5", "31, 15, 2.5, 2.5", "32, 0, 2.5, 2.5"]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=EALL", "1, 1, 2, 3, 4, 5, 6, 7, 8"]
    lines += ["2, 11, 12, 13, 14, 15, 16, 17, 18", "*ELEMENT, TYPE=C3D6, ELSET=EALL"]
    lines += ["3, 12, 21, 13, 16, 22, 17", "*SURFACE, NAME=RIGHT", "1, S4", "*SURFACE, NAME=LEFT"]
    lines += ["2, S6", "*SURFACE, NAME=FOOT", "1, S6", "*SURFACE, NAME=TIP", "3, S4"]
    lines += ["*TIE, NAME=T", "LEFT, RIGHT", "*TRANSFORM, NSET=AXIAL, TYPE=C", "0, 0, -9, 0, 0, 9"]
    lines += [
        "*NSET, NSET=AXIAL",
        "13, 17",
        "*COUPLING, CONSTRAINT NAME=A, REF NODE=32, SURFACE=FOOT",
    ]
    lines += ["*KINEMATIC", "1, 3", "*COUPLING, CONSTRAINT NAME=B, REFNODE=31, SURFACE=TIP"]
    lines += ["*DISTRIBUTING", "1, 6", "*MATERIAL, NAME=M", "*ELASTIC", "1000., 0.3", "*EXPANSION"]
    lines += ["1e-5", "*SOLID SECTION, ELSET=EALL, MATERIAL=M", "*BOUNDARY", "32, 1, 6", "AXIAL, 1"]
    lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 20.", "*STEP", "*STATIC", "*CLOAD"]
    lines += ["31, 5, 40.", "31, 1, 2.", "*DLOAD", "2, P2, 0.5", "*TEMPERATURE", "NALL, 30."]
    return "\n".join([*lines, "*END STEP"]) + "\n"


def _xdmf(mesh) -> str:
    """Series of two steps with an array of full tensors at the nodes."""
    rows = " ".join(f"{x} 0 0 0 0 0 0 0 0" for x in mesh.points[:, 0].tolist())
    cells, points = (" ".join(map(str, a.ravel().tolist())) for a in (mesh.cells, mesh.points))
    n, m = len(mesh.points), len(mesh.cells)
    step = (
        f'<Grid Name="g"><Topology TopologyType="Tetrahedron" NumberOfElements="{m}">'
        f'<DataItem Dimensions="{m} 4" NumberType="Int" Format="XML">{cells}</DataItem></Topology>'
        f'<Geometry GeometryType="XYZ"><DataItem Dimensions="{n} 3" Format="XML">{points}'
        '</DataItem></Geometry><Attribute Name="stress" AttributeType="Tensor" Center="Node">'
        f'<DataItem Dimensions="{n} 9" Format="XML">{rows}</DataItem></Attribute></Grid>'
    )
    series = f'<Grid GridType="Collection" CollectionType="Temporal">{step}{step}</Grid>'
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>{series}</Domain></Xdmf>\n'


def _msh(mesh) -> str:
    """Gmsh mesh 2.2, with a group."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '2 1 "foot"']
    lines += ["$EndPhysicalNames", "$Nodes", str(len(mesh.points))]
    lines += [f"{k} {x} {y} {z}" for k, (x, y, z) in enumerate(mesh.points.tolist(), 1)]
    foot = mesh.patches["x_min"]
    lines += ["$EndNodes", "$Elements", str(len(foot) + len(mesh.cells))]
    rows = [(2, 1, t) for t in foot] + [(4, 2, c) for c in mesh.cells]
    lines += [
        f"{k} {kind} 2 {tag} 1 " + " ".join(str(n + 1) for n in nodes)
        for k, (kind, tag, nodes) in enumerate(rows, 1)
    ]
    return "\n".join([*lines, "$EndElements"]) + "\n"


def _model(points, triangles) -> str:
    """Model of a 3MF archive with one object, placed 5 mm up."""
    rows = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in points)
    sides = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    return (
        '<model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1"><mesh><vertices>{rows}</vertices><triangles>{sides}</triangles></mesh>'
        '</object></resources><build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 5"/>'
        "</build></model>"
    )


def unv(mesh) -> str:
    """Universal file (data sets 2411, 2412, 2467) with a group of triangles for each patch."""
    lines = ["    -1", "  2411"]
    for k, (x, y, z) in enumerate(mesh.points.tolist(), 1):
        lines += [f"{k:10d}{1:10d}{1:10d}{11:10d}", f"{x:25.16E}{y:25.16E}{z:25.16E}"]
    lines += ["    -1", "    -1", "  2412"]
    # Nodes in the middle of sides lie between the corners that they join.
    order = [0, 1, 2, 3] if mesh.order == 1 else [0, 4, 1, 5, 2, 6, 7, 8, 9, 3]
    kind, number = (111 if mesh.order == 1 else 118), 0
    for nodes in mesh.cells[:, order].tolist():
        number += 1
        lines.append(f"{number:10d}{kind:10d}{1:10d}{1:10d}{7:10d}{len(nodes):10d}")
        row = "".join(f"{node + 1:10d}" for node in nodes)
        lines += [row[start : start + 80] for start in range(0, len(row), 80)]
    groups = ["    -1", "    -1", "  2467"]
    for k, (name, facets) in enumerate(mesh.patches.items(), 1):
        groups += [f"{k:10d}" + 6 * f"{0:10d}" + f"{len(facets):10d}", name]
        members = []
        for nodes in facets.tolist():
            number += 1
            lines.append(f"{number:10d}{41:10d}{1:10d}{1:10d}{7:10d}{3:10d}")
            lines.append("".join(f"{node + 1:10d}" for node in nodes))
            members.append(f"{8:10d}{number:10d}{0:10d}{0:10d}")
        groups += ["".join(members[i : i + 2]) for i in range(0, len(members), 2)]
    return "\n".join([*lines, *groups, "    -1"]) + "\n"


def bdf(mesh) -> str:
    """Nastran bulk data in free format: the k-th patch as triangles of property k, from 1."""
    lines = ["BEGIN BULK"]
    lines += [f"GRID,{k},,{x},{y},{z}" for k, (x, y, z) in enumerate(mesh.points.tolist(), 1)]
    rows = [("CTETRA", 99, nodes) for nodes in mesh.cells.tolist()]
    for k, facets in enumerate(mesh.patches.values(), 1):
        rows += [("CTRIA3", k, nodes) for nodes in facets.tolist()]
    lines += [
        f"{kind},{k},{group},{','.join(str(node + 1) for node in nodes)}"
        for k, (kind, group, nodes) in enumerate(rows, 1)
    ]
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def medit(mesh) -> str:
    """Medit mesh: the k-th patch as triangles of reference k, from 1."""
    lines = ["MeshVersionFormatted 2", "Dimension", "3", "Vertices", str(len(mesh.points))]
    lines += [f"{x} {y} {z} 0" for x, y, z in mesh.points.tolist()]
    triangles = [(*t, k) for k, those in enumerate(mesh.patches.values(), 1) for t in those + 1]
    for what, rows in (("Triangles", triangles), ("Tetrahedra", [(*c, 9) for c in mesh.cells + 1])):
        lines += [what, str(len(rows)), *(" ".join(map(str, row)) for row in rows)]
    return "\n".join([*lines, "End"]) + "\n"


def frd(mesh, stress, kind=3) -> str:
    """Results of CalculiX on linear cells, by default its type 3, tetrahedra.

    Stress is (n, 6) at the nodes: xx, yy, zz, xy, yz, zx.
    """
    number = [f" -1{k:10d}" for k in range(1, len(mesh.points) + 1)]
    lines = ["    1C", f"    2C{len(mesh.points):30d}{1:38d}"]
    lines += [
        n + "".join(f"{x:12.5E}" for x in p)
        for n, p in zip(number, mesh.points.tolist(), strict=True)
    ]
    lines += [" -3", f"    3C{len(mesh.cells):30d}{1:38d}"]
    for k, nodes in enumerate(mesh.cells.tolist(), 1):
        lines += [f" -1{k:10d}{kind:5d}    0    1", " -2" + "".join(f"{n + 1:10d}" for n in nodes)]
    lines += [" -3", " -4  STRESS      6    1"]
    lines += [f" -5  S{name:11s} 1    4    1    1" for name in ("XX", "YY", "ZZ", "XY", "YZ", "ZX")]
    lines += [
        n + "".join(f"{s:12.5E}" for s in row)
        for n, row in zip(number, stress.tolist(), strict=True)
    ]
    return "\n".join([*lines, " -3", " 9999"]) + "\n"


def mutants(content: bytes, count: int, seed: str) -> Iterator[bytes]:
    """Spoil a file in `count` ways: bytes, cuts, repeats, lines, and numbers."""
    chance = random.Random(seed)
    for _ in range(count):
        spoiled = bytearray(content)
        for _ in range(chance.choice((1, 1, 1, 2, 4))):
            chance.choice((_flip, _cut, _repeat, _line, _number, _number, _number))(spoiled, chance)
        yield bytes(spoiled)


def _flip(data: bytearray, chance: random.Random) -> None:
    for _ in range(chance.randint(1, 8)):
        if data:
            data[chance.randrange(len(data))] = chance.randrange(256)


def _cut(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    del data[start : start + chance.choice((1, 7, 100, len(data)))]


def _repeat(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data) + 1)
    piece = bytes(data[start : start + chance.choice((3, 50, 400))])
    data[start:start] = piece * chance.choice((1, 3, 40))


def _line(data: bytearray, chance: random.Random) -> None:
    lines = bytes(data).split(b"\n")
    k, j = chance.randrange(len(lines)), chance.randrange(len(lines))
    if chance.random() < 0.5:
        del lines[k]
    else:
        lines[k], lines[j] = lines[j], lines[k]
    data[:] = b"\n".join(lines)


def _number(data: bytearray, chance: random.Random) -> None:
    import re

    found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", bytes(data[:20000])))
    if found:
        one = chance.choice(found)
        data[one.start() : one.end()] = chance.choice(NUMBERS).encode()
