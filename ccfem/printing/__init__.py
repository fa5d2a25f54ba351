"""The print: layers of matrix and fibre, and all machine actions that lay them, as a table."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
