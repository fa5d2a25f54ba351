"""Old names of packages and modules: the same modules under them, with a warning."""

import importlib
import pickle
import sys
import warnings

import pytest

import ccfem
from ccfem.base.lazy_modules import GONE, MOVED
from ccfem.slicing.slicers.planar import Planar


@pytest.mark.parametrize("old", sorted(MOVED))
def test_an_old_name_is_the_same_module(old):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        module = importlib.import_module(f"ccfem.{old}")
    assert module is importlib.import_module(f"ccfem.{MOVED[old]}")
    assert module.__name__ == module.__spec__.name == f"ccfem.{MOVED[old]}"


@pytest.mark.parametrize("old", GONE)
def test_a_name_that_is_gone_says_what_replaces_it(old):
    with pytest.raises(ModuleNotFoundError, match=f"ccfem.{old} is gone: use ccfem") as gone:
        importlib.import_module(f"ccfem.{old}")
    new = str(gone.value).split("use ")[1].split(",")[0]
    module, _, name = new.rpartition(".")
    if "a function of its package has the old name" in str(gone.value):
        package, _, function = old.rpartition(".")
        assert importlib.import_module(new)
        assert callable(getattr(importlib.import_module(f"ccfem.{package}"), function))
    else:
        assert callable(getattr(importlib.import_module(module), name))


def test_an_old_name_warns_of_the_new_one_where_it_is_imported():
    sys.modules.pop("ccfem.layers.slicing.planar", None)
    with pytest.warns(
        DeprecationWarning, match=r"called ccfem\.slicing\.slicers\.planar"
    ) as warnings_seen:
        import ccfem.layers.slicing.planar as old
    assert old.Planar is Planar
    assert any(warning.filename == __file__ for warning in warnings_seen)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_what_was_pickled_under_an_old_name_is_read():
    new = pickle.dumps(Planar(count=3), protocol=0)
    assert b"ccfem.slicing.slicers.planar" in new
    old = new.replace(b"ccfem.slicing.slicers.planar", b"ccfem.layers.slicing.planar")
    assert isinstance(pickle.loads(old), Planar)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_names_that_never_were_are_not_found():
    with pytest.raises(ModuleNotFoundError, match="nothing"):
        importlib.import_module("ccfem.elasticity.nothing")
    with pytest.raises(AttributeError, match="nothing"):
        _ = ccfem.elasticity.nothing
    with pytest.raises(ModuleNotFoundError, match="elastic'"):
        importlib.import_module("ccfem.elastic")
