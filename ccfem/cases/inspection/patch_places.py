"""Where the patches of a part file lie, as far as that is known before it is meshed."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, Mistakes
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import Faces, Holes
from ccfem.cases.inspection.part_check import Check
from ccfem.cases.part_draft import PartDraft
from ccfem.cases.part_tables import rules_of


@dataclass(frozen=True)
class PatchPlace:
    """Where a patch lies."""

    corners: FloatArray  # (k, 3, 3), mm: of its triangles
    numbers: tuple[int, ...] = ()  # faces that it is made of; empty where it is none

    @property
    def centre(self) -> FloatArray:
        """Centre (3,) of the area, mm; where it has none, as points, of its corners."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        weights = areas if areas.any() else None
        return np.asarray(np.average(self.corners.mean(axis=1), axis=0, weights=weights))


def patch_places(
    draft: PartDraft, listing: BodyFaces, checked: Check | None
) -> dict[str, PatchPlace]:
    """Places of the patches of a part file, as far as they are known.

    Those by rules for faces are known at once; others, and groups of a mesh file, when the part has
    been checked.
    """
    places = {}
    if checked is not None:
        mesh = checked.case.problem.mesh
        places = {
            name: PatchPlace(mesh.points[facets[:, :3]])
            for name, facets in mesh.patches.items()
            if len(facets)
        }
    for name, rule in rules_of(draft.patches, Mistakes()).items():
        try:
            numbers = rule.numbers_on(listing) if isinstance(rule, Faces | Holes) else ()
        except InputError:  # the check says so
            continue
        rows = [listing.face(number).facets for number in numbers]
        if rows:
            corners = listing.points[listing.triangles[np.concatenate(rows)]]
            places[name] = PatchPlace(corners, numbers)
    return places
