"""What every wing stands on: arrays, tensors, checks, errors, files written whole."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
