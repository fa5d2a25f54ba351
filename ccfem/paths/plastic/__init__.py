"""The plastic of a part: walls, skins and infill, where they lie, and how stiff they are."""

from ccfem.paths.plastic.plastic import Plastic as Plastic

__all__ = ["Plastic"]
