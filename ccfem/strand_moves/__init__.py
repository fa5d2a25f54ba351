"""Strands of finished paths, moved to where they make the part stiffer."""

from ccfem.strand_moves.moving import moved

__all__ = ["moved"]
