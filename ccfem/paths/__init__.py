"""Toolpaths, and what plans them on layers."""

from ccfem.base.submodules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
