"""Cases that come with ccfem: part files in ``data``, and what no part file can say of them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.toml import read_toml
from ccfem.cases.bodies import BODIES, bolt_heads, bracket_domain, smooth_wall
from ccfem.cases.case import Case
from ccfem.cases.designed import PLATES, maker_of
from ccfem.cases.part_file import part_case
from ccfem.cases.stored import data_folder, stored_mesh
from ccfem.fem.elasticity.problem import Force, Order
from ccfem.fem.elasticity.support_kinds import PressingSupport


def shipped_cases() -> dict[str, Callable[..., Case]]:
    """Every case that comes with ccfem, by name."""
    files = {path.stem: path for path in data_folder().glob("*.toml")}
    files.pop("manifest", None)
    variants = {make.__name__: make for make in (bracket, t_bracket, two_load_plate)}
    return {
        **{name: part_maker(path) for name, path in files.items()},
        **variants,
        **{name: maker_of(plate) for name, plate in PLATES.items()},
    }


def part_maker(path: Path) -> Callable[..., Case]:
    """Return a function that makes the case of a part file with other cells, or another force.

    Its documentation is the comment at the head of the file.
    """
    content = read_toml(path, "part file")
    body = Path(content["mesh"]).stem if "mesh" in content else ""
    size = BODIES[body][1] if body else content["planform"]["edge_length"]
    first, loads = next(iter(content["loads"].items()))
    whole = float(np.round(np.linalg.norm(np.sum([load["vector"] for load in loads], axis=0)), 9))

    def make(
        element_size: float = size, order: Order = content["order"], force: float = whole
    ) -> Case:
        changed = {**content, "order": order}
        if force != whole:
            changed["loads"] = _scaled(content["loads"], force, whole)
        if not body:
            changed["planform"] = {**content["planform"], "edge_length": element_size}
            return part_case(changed, path)
        mesh = stored_mesh(body, element_size)
        if mesh is None:
            mesh = BODIES[body][0](element_size)
        return part_case(changed, path, mesh.quadratic() if order == 2 else mesh)

    lines = takewhile(
        lambda line: line.startswith("#"), path.read_text(encoding="utf-8").split("\n")
    )
    make.__doc__ = "\n".join(line[1:].strip() for line in lines) + _PARAMETERS.format(first)
    return make


_PARAMETERS = """

Parameters
----------
element_size : float, mm
    Edge length of the cells aimed at.
order : int or str
    Linear or quadratic cells, or what their estimated error calls for.
force : float, N
    Of all loads together in the load case "{}"; the other load cases grow with it.
"""


def _scaled(cases: Mapping[str, list[dict[str, Any]]], force: float, whole: float) -> Any:
    """Multiply the loads of every load case by `force` over `whole`."""
    return {
        name: [{**load, "vector": [force * x / whole for x in load["vector"]]} for load in loads]
        for name, loads in cases.items()
    }


def part_of(name: str, element_size: float, order: Order, force: float) -> Case:
    """Make the case of a part file by name."""
    return part_maker(data_folder() / f"{name}.toml")(element_size, order, force)


def bracket(
    optimised: bool = True, element_size: float = 1.75, order: Order = 1, force: float = 500.0
) -> Case:
    """Bracket of 52 x 52 x 27 mm with four bolt holes: optimised, or the full L.

    The size, and the four holes, are those of the optimised bracket of Kipping and Schueppstuhl,
    Materials 16 (2023) 998; its geometry, loads and supports are not stated there. Here it is the
    L of many papers: two legs 21 mm wide, with two holes of radius 3 mm side by side near either
    end, all along z. One pair is bolted down; the other is pressed down (y) by bolts in one load
    case, and pulled sideways (z) with 0.4 of the force in another.

    Parameters
    ----------
    optimised : bool, default True
        Whether to take the optimised part, or the full domain. The part is stored for the default
        element size; any other takes a new optimisation.
    element_size : float, mm
        Edge length of the cells of the domain.
    order : int or str
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of the load case "down", on both holes together.
    """
    if optimised:
        return part_of("bracket", element_size, order, force)
    case, mesh = part_of("bracket", 1.75, 1, force), bracket_domain(element_size)
    mesh = mesh.quadratic() if order == 2 else mesh
    return replace(
        case,
        title=case.title.replace(", optimised", ": the design domain"),
        problem=replace(case.problem, mesh=mesh, order=order),
    )


def t_bracket(
    element_size: float = 3.0, order: Order = 2, force: float = 1000.0, bolts: bool = False
) -> Case:
    """T-bracket of 130 x 60 x 30 mm: bolted down at its base, pulled by a bolt through its head.

    The shape is recovered from the layers that the authors published (GuoxinFang/
    SpatialFiberPrinting): the base's holes run along y, the head's along z. Their load is a pull of
    the head away from the base (`pull`); `side` pushes the head out of the plane of the T.

    Parameters
    ----------
    element_size : float, mm
        The mesh is stored for the default; making any other takes minutes.
    order : int or str
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of the pull; a quarter of it sideways.
    bolts : bool
        Whether strategies are tested a second time with the base's bolts as they are: walls and
        heads that only press.
    """
    case = part_of("t_bracket", element_size, order, force)
    if not bolts:
        return case
    mesh = case.problem.mesh
    pressed = {name: smooth_wall(mesh, name) for name in ("base_left", "base_right")}
    pressed |= bolt_heads(mesh)
    return replace(
        case,
        problem=replace(case.problem, mesh=mesh.with_patches(pressed)),
        alternative_supports=tuple(PressingSupport(name) for name in pressed),
    )


def two_load_plate(
    element_size: float = 1.5, order: Order = 1, force: float = 1000.0, both_ways: bool = False
) -> Case:
    """Plate 120 x 36 x 4 mm with a hole of radius 6 mm, held left; pulled or sheared right.

    Its load cases are meant to be planned for at once (``--load-case all``).

    Parameters
    ----------
    element_size : float, mm
        Edge length of the cells aimed at.
    order : int or str
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        On the right end: along x in the load case "tension", along y in "shear", in which the
        long edges are sheared as much.
    both_ways : bool, default False
        Whether there is a third load case, "shear_back", the other way.
    """
    case = part_of("two_load_plate", element_size, order, force)
    if not both_ways:
        return case
    loads = case.problem.loads
    back: list[Force] = []
    for load in loads["shear"]:
        assert isinstance(load, Force)
        x, y, z = load.vector
        back.append(replace(load, vector=(-x, -y, -z)))
    return replace(case, problem=replace(case.problem, loads={**loads, "shear_back": tuple(back)}))
