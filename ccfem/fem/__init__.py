"""Finite elements: materials, elasticity, plates, topology optimisation."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
