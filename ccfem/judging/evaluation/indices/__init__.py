"""Indices of fibre paths: one module for those that come from the same samples.

A module has

* ``COLUMNS``, a tuple of `Column`: the name, unit, formula and range of each index;
* ``sample(paths)``, which takes the samples of one layer from `LayerPaths`: a dataclass of arrays,
  which are joined over the layers; or ``SAMPLES``, the name of the module whose samples it takes;
* ``indices(samples, basis)``, the value of each index by name, of one layer or of all together;
* ``ON_SOME_LAYERS``, true where they are means and quantiles that some layers of many tell, and no
  limit of a machine bounds them; default false;
* ``BY_PATHS``, true where the samples follow from the paths in the plane of a flat layer, its
  section and what is below it: layers that repeat another have those of that one; default false;
* ``BY_LAYER``, true where the samples follow from the layer and the stress on it alone: all paths
  on the same layers have the same; default false;
* ``LARGE``, true where the samples of a layer take megabytes: those of many layers are then taken
  alone; default false;
* ``PLACE``, a number that says where its columns stand in tables; default behind all others.

Modules of other packages are found by entry points of the group ``ccfem.indices``. Nothing is
registered anywhere.
"""

from collections.abc import Mapping
from functools import cache
from types import ModuleType

from ccfem.base import plugins

__all__ = ["named"]

_LAST = 1000


@cache
def named() -> Mapping[str, ModuleType]:
    """Every module of indices by name, in the order of the tables."""
    modules = plugins.modules(__name__, "ccfem.indices")
    return dict(sorted(modules.items(), key=lambda pair: getattr(pair[1], "PLACE", _LAST)))
