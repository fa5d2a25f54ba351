"""Geometry of polylines, isocontours, offsets and hatches in the plane."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
