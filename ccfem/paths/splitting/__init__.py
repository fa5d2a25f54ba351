"""From planned paths to the strands that are printed: cut at borders and in stacks, long enough."""

from ccfem.base.lazy_modules import submodules

__all__: list[str] = []

__getattr__ = submodules(__name__)
