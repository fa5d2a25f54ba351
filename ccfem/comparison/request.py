"""What is asked of a part, in one value.

The command line, Python and studies only make a `Request`; what excludes what stands here and
nowhere else. `ccfem.comparison.engine.answer` carries it out.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from ccfem.base.arrays import freeze
from ccfem.base.checks import check_instance, check_known, check_number, member_name
from ccfem.base.errors import InputError, known_names, shown
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.load_cases import asks_for_all
from ccfem.cases.reading import read
from ccfem.fem.elasticity.solvers import check_backend
from ccfem.fem.elasticity.stress_field import GivenStress
from ccfem.fem.stress_files.stress_file import read_stress
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.paths.planning.equal_fibre import check_wanted
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.planning.strategy import Strategy
from ccfem.printing.before_solving import check_print, check_support
from ccfem.printing.course import WITHOUT_HALT, Course
from ccfem.slicing.layers.layer import plane_frame
from ccfem.slicing.layers.slicer import Slicer, check_field
from ccfem.slicing.slicers import as_slicer, from_text
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

STRATEGIES = ("stream_function", "isocurve", "contour_zigzag", "zigzag")
"""The strategies that are compared when none are named."""

DEFAULT_STRAND = Strand()
"""Stiffness and strength of a strand where nothing else is known."""

_UNIT = "N/mm"

_COUNTED_BY = ("count", "thickness", "heights")
"""Parameters of flat layers that say how many there are."""


@dataclass(frozen=True)
class ForeignStress:
    """Stress of another program in a file: see `ccfem.fem.stress_files.read_stress`.

    Attributes
    ----------
    unit : str, optional
        Unit of the stress, if the file does not state it.
    array : str, optional
        Name of the array in a ``.vtu`` or ``.vtk`` file.
    step : int, optional
        Step in a ``.frd`` file, needed where several have stress.
    components : str, optional
        Order of six components without names, as ``xx,yy,zz,xy,yz,xz``.
    """

    path: str | os.PathLike[str]
    unit: str | None = None
    array: str | None = None
    step: int | None = None
    components: str | None = None

    def on(self, mesh: TetMesh, held_or_loaded: tuple[str, ...] = ()) -> GivenStress:
        """Read the stress onto a mesh, with the names of the patches that are held or loaded."""
        about = (self.unit, self.array, held_or_loaded, self.step, self.components)
        return read_stress(self.path, mesh, *about)


@dataclass(frozen=True)
class Natural:
    """The amount of fibre that each strategy lays with its own parameters."""


@dataclass(frozen=True)
class Shortest:
    """The shortest natural length of any strategy, for all: a comparison at equal fibre."""


@dataclass(frozen=True)
class PerLayer:
    """A length of fibre per layer, mm, as a mean over the layers."""

    length: float

    def __post_init__(self) -> None:
        check_wanted(self.length)


@dataclass(frozen=True)
class InAll:
    """A length of fibre in all layers together, mm."""

    length: float

    def __post_init__(self) -> None:
        check_number("fibre in all", self.length, above=0.0, unit="mm")


@dataclass(frozen=True)
class Stiffness:
    """The least fibre that makes the part as stiff as this."""

    value: float  # stiffness over that of the part without fibre, or N/mm
    absolute: bool = False  # whether it is N/mm

    @classmethod
    def parsed(cls, text: str) -> "Stiffness":
        """Read a ratio as ``2.5``, or ``1200N/mm``."""
        stripped = text.strip()
        try:
            return cls(float(stripped.removesuffix(_UNIT)), stripped.endswith(_UNIT))
        except ValueError:
            raise InputError(
                f"--stiffness expects a ratio as 2.5, or N/mm as 1200N/mm; got '{text}'"
            ) from None


@dataclass(frozen=True)
class Spread:
    """Several lengths of fibre by one factor, from a sixteenth of what fills the most layers up."""

    points: int = 5  # lengths, at least 2

    def __post_init__(self) -> None:
        check_number("points", self.points, at_least=2)


Amount = Natural | Shortest | PerLayer | InAll | Stiffness | Spread
"""How much fibre is asked for."""

SHORTEST = Shortest()

LONGEST_TEST = 3e6
"""Length of fibre, mm, up to which `ccfem plan` tests a plan virtually without being asked to: such
a test takes about as long as the rest."""

MOST_LAYERS = 60
"""Layers on which indices are taken that some of more layers tell; of more layers those that are
alike are planned once."""

Wanted = float | InAll | None
"""Length of fibre that runs are held to: mm per layer, in total, or None if each lays its own."""


@dataclass(frozen=True)
class Slicing:
    """A way to cut the part."""

    slicer: Slicer | None = None  # None for the part's own
    # Whether flat layers are as thick as those of the part's own slicing are in the mean: one
    # printer lays them all.
    as_thick: bool = False


@dataclass(frozen=True)
class Request:
    """A part, and what is asked of it.

    Every strategy is planned on every slicing to the amount of fibre, for the load cases, and
    judged. One slicing without a name stands for the part alone; slicings with names are compared
    with each other, at the same length of fibre in all.

    Attributes
    ----------
    strategies : mapping of name to Strategy
        At least one.
    slicings : mapping of name to Slicing
        At least one; by default the part's own, without a name.
    amount : Natural, Shortest, PerLayer, InAll, Stiffness or Spread, default Shortest
    load_case : str, optional
        Load case to plan, evaluate and test for; by default the first. "all" plans for all of them
        at once, weighted by `Case.weights`, tests under all, and ranks by the worst.
    strand : Strand or None
        Stiffness and strength of a strand in the virtual test; None leaves the test out.
    stress : ForeignStress, optional
        Stress of another program, on the same mesh, to plan and evaluate on. Virtual tests and the
        bound still solve the part themselves.
    backend : str, default "auto"
        As in `ccfem.solve`.
    curve : bool, optional
        Test every strategy at three to five lengths of fibre. By default only if a strategy cannot
        change its amount of fibre to the wanted length, and the part is not large
        (`ccfem.comparison.effort.LONGEST_CURVE`).
    bound : bool, default True
        Whether to compute what no paths can exceed.
    print_plans : bool, default False
        Also plan the print of the whole part, matrix and fibre, for every run.
    support : bool, default False
        Also print support below the part.
    course : Course
        Where the file of a print begins and halts.
    every_layer : bool, default False
        Take all indices on every layer. By default those that some layers tell are taken on 60
        layers, evenly spread, where there are more; of these, layers that are alike are planned
        once (`ccfem.paths.planning.alike`).
    longest_test : float, mm, default infinite
        Length of fibre above which a plan is not tested virtually.
    breaking_load : bool, default False
        Also follow every plan to the load that breaks it (`ccfem.breaking_load`), an experiment
        that takes minutes a plan, under the heaviest load case.

    Raises
    ------
    InputError
        For what does not go together, before anything is solved.
    """

    case: Case
    strategies: Mapping[str, Strategy]
    slicings: Mapping[str, Slicing] = field(default_factory=lambda: {"": Slicing()})
    amount: Amount = SHORTEST
    load_case: str | None = None
    strand: Strand | None = DEFAULT_STRAND
    stress: ForeignStress | None = None
    backend: str = "auto"
    curve: bool | None = None
    bound: bool = True
    print_plans: bool = False
    support: bool = False
    course: Course = WITHOUT_HALT
    every_layer: bool = False
    longest_test: float = float("inf")
    breaking_load: bool = False

    def __post_init__(self) -> None:
        freeze(self, strategies=dict, slicings=dict)
        if not self.strategies:
            raise InputError("name at least one strategy to compare; got none")
        for strategy in self.strategies.values():
            check_instance("strategy", strategy)
        if self.curve and self.strand is None:
            raise InputError("the curve is one of stiffness: leave the virtual test in, or it out")
        if self.breaking_load and self.strand is None:
            raise InputError("the breaking load is of a virtual test: leave that in, or it out")
        if self.curve and isinstance(self.amount, Spread):
            raise InputError("several lengths are planned for already: leave the curve out")
        if self.named:
            self._check_named()
        if isinstance(self.amount, Stiffness):
            self._check_stiffness()
        if not self.case.plastic.solid:
            self._check_plastic()
        if self.print_plans:
            self._check_print()
        elif self.support:
            raise InputError("support is laid in a print: plan that too (print_plans, --gcode)")
        elif self.course:
            raise InputError("pauses and a first layer are of a print: add --gcode (print_plans)")
        self._check_load_case()
        check_backend(self.backend)

    def _check_print(self) -> None:
        """Refuse a print that cannot be made whatever is planned, before anything is solved."""
        case = self.case
        (slicing,) = self.slicings.values()
        layers = case.known_layers(slicing.slicer)
        check_print(case.problem.mesh, case.build, case.machine, layers, case.bed)
        if self.support:
            check_field(case.slicing if slicing.slicer is None else slicing.slicer)
            if layers:
                check_support(case.problem.mesh, layers, case.machine)

    def _check_load_case(self) -> None:
        known = self.case.problem.cases
        if not known:
            raise InputError(f"case '{self.case.name}' has no load case; give it at least one load")
        if not self.all_cases:
            if self.load_case is not None:
                check_known("load case", self.load_case, known)
            return
        if self.strand is None:
            raise InputError(
                "plans for all load cases are cut and ranked by virtual tests: leave these in, or "
                "name one load case"
            )
        refused = {
            "stress of another program": self.stress is not None,
            "a curve": bool(self.curve),
            "several slicings": self.named and not isinstance(self.amount, Spread),
        }
        for what, asked in refused.items():
            if asked:
                raise InputError(
                    f"all load cases are planned for at once; got {what} too: drop one"
                )

    def _check_named(self) -> None:
        given = any(isinstance(strategy, GivenPaths) for strategy in self.strategies.values())
        if isinstance(self.amount, PerLayer | Stiffness) or given or self.curve:
            raise InputError(
                f"over several slicings there are no {_options('layers', 'fibre_per_layer')}, "
                f"{_options('stiffness', 'curve')} or given paths: drop them, and give "
                f"{_options('fibre')}, the length in all"
            )
        if self.print_plans:
            raise InputError("prints are planned on one slicing: drop print_plans or slicings")

    def _check_plastic(self) -> None:
        """Refuse what changes the layers of a part whose plastic depends on them."""
        if self.named or isinstance(self.amount, Stiffness | Spread):
            raise InputError(
                f"plastic.infill '{self.case.plastic.infill}' is solid near fibre, so that the "
                "part without fibre changes with its layers: compare slicings, plan for a "
                "stiffness and lay several lengths with infill = 'solid' "
                "(--set-plastic infill=solid)"
            )

    def _check_stiffness(self) -> None:
        if len(self.strategies) > 1:
            raise InputError("the fibre for a stiffness is that of one strategy: name one")
        if self.strand is None:
            raise InputError("--stiffness is that of the virtual test: drop --no-virtual-test")
        if self.stress is not None:
            raise InputError("--stiffness solves the part itself: drop --stress")

    @classmethod
    def of(
        cls,
        case: Case | str | os.PathLike[str],
        strategies: Mapping[str, Strategy] | Sequence[str | Strategy] = STRATEGIES,
        layers: int | Sequence[float] | str | Slicer | None = None,
        slicings: Mapping[str, Slicer] | Sequence[str | Slicer] | None = None,
        fibre_per_layer: float | None = None,
        fibre: float | None = None,
        natural: bool = False,
        stiffness: str | None = None,
        **more: Any,
    ) -> "Request":
        """Make a request from short forms: names, numbers and texts.

        Parameters
        ----------
        case, strategies, layers, slicings, fibre_per_layer, fibre, natural, stiffness
            As in `ccfem.compare`.
        **more
            As the attributes of the class.
        """
        case = read(case)
        if not isinstance(strategies, Mapping):
            strategies = named_strategies(case, strategies)
        amount = _amount(fibre_per_layer, fibre, natural, stiffness)
        if slicings is not None:
            if layers is not None:
                raise InputError(
                    f"over several slicings there are no {_options('layers')}: drop these or "
                    f"{_options('slicings')}"
                )
            return cls(case, strategies, named_slicings(slicings), amount, **more)
        given = [strategy for strategy in strategies.values() if isinstance(strategy, GivenPaths)]
        up = plane_frame(case.build)[2]
        # Paths that are not flat belong to the part's own layers where these are curved.
        flat = isinstance(case.slicing, Planar) or all(paths.are_flat(up) for paths in given)
        if given and layers is None and flat:
            layers = tuple(given[0].heights(up).tolist())
        slicing = Slicing(None if layers is None else as_slicer(layers))
        return cls(case, strategies, {"": slicing}, amount, **more)

    @property
    def named(self) -> bool:
        """Whether slicings are compared with each other."""
        return list(self.slicings) != [""]

    @property
    def only_slicer(self) -> Slicer | None:
        """Slicer of the only slicing; None for the part's own, and where several are compared."""
        slicing = self.slicings.get("")
        return None if slicing is None else slicing.slicer

    @property
    def all_cases(self) -> bool:
        """Whether all load cases are planned for at once."""
        return asks_for_all(self.case, self.load_case)

    def on_slicing(self, strategy: str, slicing: str) -> str:
        """Name of the run of a strategy on a slicing."""
        return f"{strategy} on {slicing}" if slicing else strategy


def _options(*names: str) -> str:
    """Parameters as they are called in Python and on the command line."""
    return ", ".join(f"{name} (--{name.replace('_', '-')})" for name in names)


def _amount(
    fibre_per_layer: float | None, fibre: float | None, natural: bool, stiffness: str | None
) -> Amount:
    """Amount of fibre from the one of four options that is given."""
    given = {
        "fibre_per_layer": fibre_per_layer is not None,
        "fibre": fibre is not None,
        "natural": natural,
        "stiffness": stiffness is not None,
    }
    names = [name for name, is_given in given.items() if is_given]
    if len(names) > 1:
        raise InputError(
            "give one amount of fibre: a length per layer, one in all, the natural amount or a "
            f"stiffness, not both {_options(names[0])} and {_options(names[1])}: drop one"
        )
    if fibre_per_layer is not None:
        return PerLayer(fibre_per_layer)
    if fibre is not None:
        return InAll(fibre)
    if stiffness is not None:
        return Stiffness.parsed(stiffness)
    return Natural() if natural else SHORTEST


def named_strategies(
    case: Case,
    strategies: Sequence[str | Strategy] = STRATEGIES,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Strategy]:
    """Make strategies by name, with the parameters of the case, which those given override.

    Parameters
    ----------
    strategies : sequence of str or Strategy
        A strategy object keeps its parameters and gets the name of its module; a second one of the
        same name gets a number.

    Raises
    ------
    InputError
        For an unknown strategy or parameter, or one named twice.
    """
    if isinstance(strategies, str | type) or not isinstance(strategies, Sequence):
        raise InputError(
            f"strategies must be a list, as ['isocurve', 'zigzag']; got {shown(strategies)}: "
            "write it in [ ]"
        )
    overrides = dict(parameters or {})
    names = [strategy for strategy in strategies if isinstance(strategy, str)]
    if not strategies:
        raise InputError("name at least one strategy to compare; got none")
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise InputError(f"name each strategy once; got '{min(repeated)}' more than once")
    for name in overrides:
        if name not in names:
            raise InputError(
                f"parameters are given for '{name}', which is not among the strategies: "
                f"{known_names(name, names)}"
            )
    made: dict[str, Strategy] = {}
    for strategy in strategies:
        if isinstance(strategy, str):
            chosen = {**case.parameters.get(strategy, {}), **overrides.get(strategy, {})}
            made[strategy] = create(strategy, chosen)
        else:
            check_instance("strategy", strategy)
            made[free_name(member_name(strategy), {*made, *names})] = strategy
    return made


def named_slicings(slicings: Mapping[str, Slicer] | Sequence[str | Slicer]) -> dict[str, Slicing]:
    """Slicings by name: as they were written, or the name of their module.

    Flat layers named by a text that says nothing of their number are as thick as the layers of the
    part's own slicing are in the mean.

    Raises
    ------
    InputError
        For an unknown slicer or parameter, none at all, or one named twice.
    """
    if isinstance(slicings, str) or not slicings:
        raise InputError(
            f"slicings must be a list of at least one, as ['planar:z', 'spatial']; got {slicings!r}"
        )
    if isinstance(slicings, Mapping):
        for slicer in slicings.values():
            check_instance("slicer", slicer)
        return {name: Slicing(slicer) for name, slicer in slicings.items()}
    made: dict[str, Slicing] = {}
    for given in slicings:
        if isinstance(given, str):
            name, slicer = given.strip(), from_text(given)
            if name in made:
                raise InputError(f"name each slicing once; got '{name}' more than once")
            counted = any(f"{parameter}=" in name for parameter in _COUNTED_BY)
            made[name] = Slicing(slicer, isinstance(slicer, Planar) and not counted)
        else:
            check_instance("slicer", given)
            made[free_name(member_name(given), set(made))] = Slicing(given)
    return made


def free_name(name: str, taken: set[str]) -> str:
    """Name, with a number behind it where it is taken."""
    if name not in taken:
        return name
    return next(free for free in (f"{name}_{k}" for k in count(2)) if free not in taken)
