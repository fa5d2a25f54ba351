"""Faces that are chosen: those alike, and the rule of a part file that chooses them again."""

import json
from collections.abc import Collection
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import Faces, Holes
from ccfem.body.mesh.smooth_faces import direction_text
from ccfem.slicing.layers.layer import plane_frame

_PARALLEL = np.cos(np.radians(5.0))
"""Cosine of the angle up to which planes face the same way."""
_LEVEL = 1e-3
"""Distance, in diagonals, up to which planes lie in one."""


def like_holes(listing: BodyFaces, number: int) -> list[int]:
    """Numbers of the walls of all holes of the radius of a face; itself alone where it is none."""
    face = listing.face(number)
    if face.kind != "cylinder" or not face.hollow:
        return [number]
    return list(Holes(float(f"{face.radius:.3g}")).numbers_on(listing))


def coplanar(listing: BodyFaces, number: int) -> list[int]:
    """Numbers of the planes at the height of a plane that face the same way, itself included.

    One normal says where all of them are.
    """
    plane, reach = listing.face(number), _LEVEL * listing.size
    pairs = zip(listing.numbers, listing.faces, strict=True)
    return sorted(
        k
        for k, face in pairs
        if k == number
        or (
            face.kind == plane.kind == "plane"
            and face.direction @ plane.direction > _PARALLEL
            and abs((face.centre - plane.centre) @ plane.direction) <= reach
        )
    )


def face_rule(listing: BodyFaces, numbers: Collection[int]) -> dict[str, Any]:
    """Table of the rule that chooses faces: all holes of a radius, else their places.

    Where places do not tell them from others it has their numbers.
    """
    wanted, radius = sorted(numbers), listing.face(min(numbers)).radius
    if len(wanted) > 1 and wanted == like_holes(listing, wanted[0]):
        return {"rule": "holes", "radius": float(f"{radius:.3g}")}
    places = [listing.place(number) for number in wanted]
    points = [list(place["at"]) for place in places]
    place: dict[str, Any] = {"at": points[0] if len(points) == 1 else points}
    for keys in (("normal",), ("axis", "radius")):
        those = [[_written(place.get(key)) for key in keys] for place in places]
        if None not in those[0] and all(entry == those[0] for entry in those):
            place |= dict(zip(keys, those[0], strict=True))
    try:
        right = sorted(Faces(**place).numbers_on(listing)) == wanted
    except InputError:
        right = False
    return {"rule": "face", **(place if right else {"number": wanted})}


def _written(value: FloatArray | float | None) -> Any:
    return value if value is None or isinstance(value, float) else direction_value(value)


def proposed_load(listing: BodyFaces, numbers: Collection[int]) -> tuple[str, FloatArray | None]:
    """Kind and direction (3,) of the load that is the likeliest on faces.

    Round walls bear a pin, across their axis and away from the middle of the body; a plane is
    pulled along its normal. Of others no direction is known.
    """
    faces = [listing.face(number) for number in numbers]
    if all(face.kind == "cylinder" for face in faces):
        middle = 0.5 * (listing.points.min(axis=0) + listing.points.max(axis=0))
        return "bearing", across(faces[0].direction, faces[0].centre - middle)
    return "force", faces[0].direction if [face.kind for face in faces] == ["plane"] else None


def across(axis: FloatArray, away: FloatArray) -> FloatArray:
    """Return the unit vector (3,) across an axis along x, y or z that goes most along another."""
    square = np.eye(3)[np.abs(axis) < 1e-6]
    if not len(square):
        square = plane_frame(axis.tolist())[:2]
    along = square @ away
    k = int(np.argmax(np.abs(along)))
    return np.asarray(np.copysign(1.0, along[k]) * square[k])


def direction_value(direction: FloatArray) -> Any:
    """Direction as a part file has it: the name of an axis, or three numbers."""
    text = direction_text(direction)
    return json.loads(text) if text.startswith("[") else text


def patch_name(listing: BodyFaces, numbers: Collection[int], normal: object) -> str:
    """Name for a patch of faces, by their kind and size or direction, not by what acts on them.

    The normal is that of its rule: the name of an axis, or anything else.
    """
    faces = [listing.face(number) for number in numbers]
    kinds = {face.kind for face in faces}
    several = "s" if len(faces) > 1 else ""
    if kinds == {"cylinder"} and len({f"{face.radius:.3g}" for face in faces}) == 1:
        what = "hole" if all(face.hollow for face in faces) else "round"
        return f"{what}{several}_r{faces[0].radius:.3g}".replace(".", "_")
    if kinds == {"plane"} and isinstance(normal, str):
        return f"plane{several}_{normal.replace('-', 'minus_')}"
    return "face" + several if kinds != {"plane"} else "plane" + several
