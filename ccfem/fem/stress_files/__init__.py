"""Stress of other programs, read from files."""

from ccfem.fem.stress_files.stress_file import read_stress

__all__ = ["read_stress"]
