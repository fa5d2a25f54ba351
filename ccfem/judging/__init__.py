"""Indices of paths, and the virtual test of the part that holds them."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
