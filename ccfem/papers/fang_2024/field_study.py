"""The field and its layers under other weights, thicknesses, terms of the joints, and meshes."""

from typing import Any

import numpy as np

from ccfem.base.errors import InputError
from ccfem.cases.t_bracket import t_bracket
from ccfem.fem.elasticity.solve import solve
from ccfem.geometry.locate import locate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.spatial import Spatial, SpatialSlicing
from ccfem.strategies import create

BUILD = (0.0, 1.0, 0.0)

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "smoothness 0.001": {"smoothness": 0.001},
    "smoothness 0.1": {"smoothness": 0.1},
    "smoothness 1": {"smoothness": 1.0},
    "joints 0.1": {"joint_weight": 0.1},
    "joints 10": {"joint_weight": 10.0},
    "ring": {"form": "ring"},
    "literal": {"form": "literal"},
    "all lines": {"lines": "all"},
    "thickness 0.3": {"thickness": 0.3},
    "thickness 0.8": {"thickness": 0.8},
}
"""Parameters of `Spatial`: weights of the paper's figure 7, the joints' term, its line filter."""

COLUMNS = ("angle_mean", "within_10", "thickness_5", "thickness_50", "thickness_95", "folded")


def field_study(fine: SpatialSlicing) -> dict[str, float]:
    """Figures by "VARIANT quantity" on the mesh of the case, and "84 k cells" on the authors' part.

    Parameters
    ----------
    fine : SpatialSlicing
        Of the authors' part, with the default parameters.
    """
    stress = solve(t_bracket(order=1).problem)["pull"]
    found: dict[str, float] = {}
    slicings: dict[str, SpatialSlicing] = {}
    for name, given in VARIANTS.items():
        try:
            slicings[name] = Spatial(**given).slice(stress, BUILD)
        except InputError as error:
            print(f"{name}: {error}")
            continue
        found |= _figures(name, slicings[name])
    found |= _figures("84 k cells", fine)
    found["degrees between normals on 30 k and 84 k cells"] = _between(slicings["default"], fine)
    for name, cut in (("cut", True), ("no cut", False)):
        layers = slicings["default"].layers
        paths = plan(create("winding", {"cut": cut}), layers, stress, Machine())
        found[f"{name} strands a layer"] = len(paths) / len(np.unique(paths.layer))
    return found


def _figures(name: str, slicing: SpatialSlicing) -> dict[str, float]:
    quality = vars(slicing.quality)
    pieces = [int(layer.component.max()) + 1 for layer in slicing.layers]
    found = {f"{name} {column}": float(quality[column]) for column in COLUMNS}
    ratio = quality["thickness_95"] / quality["thickness_5"]
    return {
        **found,
        f"{name} thickness ratio": float(ratio),
        f"{name} pieces a layer": float(np.mean(pieces)),
        f"{name} layers": float(len(slicing.layers)),
    }


def _between(one: SpatialSlicing, other: SpatialSlicing) -> float:
    """Mean angle, degrees, by volume, between the normals of two fields on meshes of one part.

    The part is its own mirror image in z, and so are fields of other signs of as low an energy:
    the nearer of the two counts.
    """
    mesh, own = other.field.mesh, one.field.mesh
    centre = own.points[own.corners].mean(axis=1)
    found = []
    for mirror in ([1.0, 1.0, 1.0], [1.0, 1.0, -1.0]):
        holder, _ = locate(mesh.points, mesh.corners, centre * mirror, 2.0)
        inside = holder >= 0
        a, b = one.field.gradient[inside], other.field.gradient[holder[inside]] * mirror
        size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        cosine = np.abs(np.einsum("ed,ed->e", a, b)) / np.maximum(size, 1e-300)
        angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
        found.append(float(np.average(angle, weights=own.volumes[inside])))
    return min(found)


def field_table(found: dict[str, float]) -> str:
    """Markdown table of the variants."""
    heads = (*COLUMNS, "thickness ratio", "pieces a layer", "layers")
    lines = [f"| field | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for name in (*VARIANTS, "84 k cells"):
        values = [found.get(f"{name} {head}", np.nan) for head in heads]
        lines.append(f"| {name} | {' | '.join(f'{value:.3g}' for value in values)} |")
    return "\n".join(lines)
