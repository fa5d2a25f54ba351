"""What may be wrong with patches: a wall taken in part, facets of other faces, holes forgotten."""

from collections.abc import Mapping

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.body.mesh.face_rules import numbered_faces
from ccfem.body.mesh.patches import Box, Cylinder, PatchRule, Plane
from ccfem.body.mesh.smooth_faces import Face
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import are_among

_ALL = 0.98
"""Share of the area of a wall from which it counts as taken whole."""
_SOME = 0.01
"""Share of the area of a patch or a face up to which a part of it is not worth a word."""
_SAME = 0.02
"""Share by which radii, and sine by which axes, of like holes may differ."""
_ASIDE = np.cos(np.radians(30.0))


def about_patches(mesh: TetMesh, rules: Mapping[str, PatchRule]) -> tuple[str, ...]:
    """Say what rules may have caught, or missed, against their author's intention.

    Parameters
    ----------
    mesh : TetMesh
        With the patches of the rules.
    rules : mapping of patch name to rule

    Returns
    -------
    tuple of str
        One line for each doubt, with the cure; empty where every patch looks as meant.
    """
    guessed = {n: r for n, r in rules.items() if isinstance(r, Box | Cylinder | Plane)}
    if not guessed:
        return ()
    area, normal = mesh.facet_areas(mesh.boundary)
    faces = numbered_faces(mesh).faces
    taken = {name: are_among(mesh.boundary, mesh.patches[name]) for name in rules}
    anywhere = np.any(list(taken.values()), axis=0)
    lines: list[str] = []
    for name, rule in guessed.items():
        chosen = taken[name]
        parts = _parts(faces, chosen, area)
        if isinstance(rule, Cylinder):
            lines += _about_cylinder(name, rule, parts)
            lines += _forgotten(name, parts, faces, anywhere, area)
        elif isinstance(rule, Box):
            lines += _about_box(name, rule, parts)
        else:
            lines += _about_plane(name, rule, normal[chosen], area[chosen])
    return tuple(lines)


def _parts(
    faces: tuple[Face, ...], chosen: BoolArray, area: FloatArray
) -> list[tuple[Face, float, float]]:
    """Each face that a patch touches, with its share of the patch, and how much of it is taken."""
    total = float(area[chosen].sum())
    parts = []
    for face in faces:
        size = float(area[face.facets][chosen[face.facets]].sum())
        if size > _SOME * min(total, face.area):
            parts.append((face, size / total, size / face.area))
    return parts


def _about_cylinder(name: str, rule: Cylinder, parts: list[tuple[Face, float, float]]) -> list[str]:
    """Say where a round wall is taken in part, or other faces with it."""
    lines = []
    for face, share, covered in parts:
        if face.kind != "cylinder":
            lines.append(
                f"patch '{name}': {share:.0%} of what its cylinder selects is not a round wall "
                f"but a {face.about}: reduce the radius or the tolerance, or use rule 'face'"
            )
        elif rule.half is None and covered < _ALL:
            lines.append(
                f"patch '{name}' takes {covered:.0%} of a {face.about}: put the cylinder there, or "
                "choose by rule 'holes' or 'face'"
            )
    return lines


def _forgotten(
    name: str,
    parts: list[tuple[Face, float, float]],
    faces: tuple[Face, ...],
    anywhere: BoolArray,
    area: FloatArray,
) -> list[str]:
    """Name walls like the one that a cylinder takes that are in no patch."""
    walls = [face for face, *_ in parts if face.kind == "cylinder" and face.turn > 180.0]
    if len(walls) != 1:
        return []
    (wall,) = walls
    others = []
    for face in faces:
        if face.kind != "cylinder" or face.hollow != wall.hollow or face is wall:
            continue
        alike = abs(face.radius - wall.radius) <= _SAME * wall.radius
        parallel = np.linalg.norm(np.cross(face.direction, wall.direction)) <= _SAME
        free = float(area[face.facets][anywhere[face.facets]].sum()) < _SOME * face.area
        if alike and parallel and free and face.turn > 180.0:
            others.append(face)
    if not others:
        return []
    where = "; ".join(face.about for face in others[:3])
    return [
        f"patch '{name}' is one of {len(others) + 1} like walls; in no patch: {where}: take all by "
        f"rule 'holes' with radius {wall.radius:.3g} if they belong together"
    ]


def _about_box(name: str, rule: Box, parts: list[tuple[Face, float, float]]) -> list[str]:
    """Say where a box takes facets that face in several directions."""
    directions = [face.direction for face, *_ in parts if face.kind == "plane"]
    several = any(direction @ other < _ASIDE for direction in directions for other in directions)
    if rule.normal is not None or not several:
        return []
    named = ", ".join(dict.fromkeys(face.along for face, *_ in parts if face.kind == "plane"))
    return [
        f"patch '{name}': its box takes facets of {len(parts)} faces, with normals {named}: give "
        "the box a normal, or choose by rule 'face'"
    ]


def _about_plane(name: str, rule: Plane, normal: FloatArray, area: FloatArray) -> list[str]:
    """Say where facets face both ways, as those of a sheet thinner than the tolerance do."""
    up = float(area[normal @ normal[0] > 0.0].sum())
    down = float(area.sum()) - up
    if min(up, down) <= _SOME * (up + down):
        return []
    return [
        f"patch '{name}': its plane takes {up:.4g} mm^2 that face one way and {down:.4g} mm^2 that "
        "face the other: lessen the tolerance below the thickness, or choose by rule 'face'"
    ]
