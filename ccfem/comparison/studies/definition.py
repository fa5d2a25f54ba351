"""What a study runs: parts, slicings, strategies and parameters, from a file or from Python."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ccfem.base.arrays import freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.toml import from_table, read_toml
from ccfem.cases.case import check_name
from ccfem.comparison.request import DEFAULT_STRAND
from ccfem.judging.virtual_testing.strand import Strand


@dataclass(frozen=True)
class Study:
    """Parts x slicings x load cases x strategies x lengths of fibre.

    In a study file each entry of parts, slicings and strategies is a name or a table; the tables
    have ``name``, parameters, and ``sweep``, either lists by parameter, of which every combination
    is run, or a list of tables, of which each is run::

        name = "densities"
        parts = ["bar", "hook.toml"]            # cases, and part files beside the study file
        slicings = ["planar:count=4"]           # default: the parts' own
        load_cases = ["pull"]                   # default: the first of each part
        fibre_per_layer = [500.0, 1000.0]       # mm; default: what each strategy lays by itself
        virtual_test = true                     # default

        [[strategies]]
        name = "isocurve"
        sweep.density = [0.5, 1.0, 2.0]         # a grid ...
        sweep.power = [0.5, 1.0]

        [[strategies]]
        name = "zigzag"
        sweep = [{ spacing = 2.0 }, { spacing = 4.0, angle = 45.0 }]  # ... or a list

        [[parts]]
        name = "bar"
        sweep.element_size = [3.0, 2.0]

    Attributes
    ----------
    parts : tuple
        Names, tables, or `Case` values.
    strategies : tuple
        Names, tables, or `Strategy` values. Those by name take the parameters of the case, too.
    slicings : tuple
        Names with parameters as on the command line, tables, or `Slicer` values.
    load_cases : tuple of str
    fibre_per_layer : tuple of float, mm
        Lengths that every strategy is held to.
    virtual_test : bool, default True
    strand : Strand
        What a strand is worth in the virtual test.
    backend : str, default "auto"
        As in `ccfem.solve`.
    name : str, default "study"
        Of the folder.
    folder : path, optional
        From which part files are found; default the current one.
    """

    parts: tuple[Any, ...]
    strategies: tuple[Any, ...]
    slicings: tuple[Any, ...] = ()
    load_cases: tuple[str, ...] = ()
    fibre_per_layer: tuple[float, ...] = ()
    virtual_test: bool = True
    strand: Strand = DEFAULT_STRAND
    backend: str = "auto"
    name: str = "study"
    folder: Path = Path()

    def __post_init__(self) -> None:
        for field in ("parts", "strategies", "slicings", "load_cases", "fibre_per_layer"):
            given = getattr(self, field)
            if isinstance(given, str | Mapping) or not hasattr(given, "__iter__"):
                object.__setattr__(self, field, (given,))
        kinds: Any = dict.fromkeys(
            ("parts", "strategies", "slicings", "load_cases", "fibre_per_layer"), tuple
        )
        freeze(self, **kinds)
        for field in ("parts", "strategies"):
            if not getattr(self, field):
                raise InputError(f"a study needs at least one of its {field}; got none: name one")
        for length in self.fibre_per_layer:
            check_number("fibre_per_layer", length, above=0.0, unit="mm")
        check_name(self.name, self.name)


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a study file (TOML); nothing in it is executed.

    Raises
    ------
    InputError
        For a file that cannot be read, an unknown key, or a value of another type.
    """
    path = Path(path)
    table = read_toml(path, "study file")
    if not table:
        raise InputError(f"study file {path} is empty: give it parts and strategies")

    def make(
        parts: tuple[str | dict[str, Any], ...],
        strategies: tuple[str | dict[str, Any], ...],
        slicings: tuple[str | dict[str, Any], ...] = (),
        load_cases: tuple[str, ...] = (),
        fibre_per_layer: float | tuple[float, ...] = (),
        virtual_test: bool = True,
        strand: Strand = DEFAULT_STRAND,
        backend: str = "auto",
        name: str = path.stem,
    ) -> Study:
        lengths = fibre_per_layer if isinstance(fibre_per_layer, tuple) else (fibre_per_layer,)
        options = (slicings, load_cases, lengths, virtual_test, strand, backend, name)
        return Study(parts, strategies, *options, path.absolute().parent)

    return from_table(make, table, path.name)
