"""Layers, flat and curved, and the slicers that cut a part into them."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
