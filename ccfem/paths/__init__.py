"""Toolpaths, and what plans them on layers."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
