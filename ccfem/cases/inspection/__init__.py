"""A part seen before it is solved: its mesh, patches, loads and supports, and what is doubtful."""

from ccfem.body.mesh.face_places import BodyFaces
from ccfem.cases.inspection.beginning import examples, new_part, write_example
from ccfem.cases.inspection.body_faces import faces
from ccfem.cases.inspection.part_check import Check, LoadRow, PatchRow, check

__all__ = [
    "BodyFaces",
    "Check",
    "LoadRow",
    "PatchRow",
    "check",
    "examples",
    "faces",
    "new_part",
    "write_example",
]
