"""Strands of finished paths, moved to where they make the part stiffer."""

from ccfem.strand_moves.moving import SPARE, moved, moved_to_length

__all__ = ["SPARE", "moved", "moved_to_length"]
