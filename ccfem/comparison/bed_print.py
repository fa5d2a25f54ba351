"""Different parts in one file: each is planned by its own request, all are printed together."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ccfem.base.arrays import freeze
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.comparison.engine import answer, check_slicings
from ccfem.comparison.headline import headline_values
from ccfem.comparison.request import Request, free_name
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.table import Cell, Head, Row, Table
from ccfem.machine.machine import Machine
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.before_solving import check_room, in_air
from ccfem.printing.course import WITHOUT_HALT, Course, on_course
from ccfem.printing.export.gcode import clock
from ccfem.printing.moves import Moves
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.print_totals import PrintTotals, print_totals
from ccfem.printing.together import arranged

_OWN = ("matrix_height",)
"""Values of a machine that each part may have of its own: how high its layers are."""


@dataclass(frozen=True)
class BedPrint:
    """Parts that are printed together.

    Attributes
    ----------
    comparisons : mapping of str to Comparison
        Of each part by its name, with its only run.
    print_plan : PrintPlan
        Of all parts.
    print_totals : PrintTotals
        Of all, with the share of each part.
    """

    comparisons: Mapping[str, Comparison]
    machine: Machine
    print_plan: PrintPlan
    moves: Moves
    print_totals: PrintTotals
    name: str = "bed"

    def __post_init__(self) -> None:
        freeze(self, comparisons=dict)

    @property
    def runs(self) -> dict[str, Run]:
        """Run of each part."""
        return {name: comparison.runs[0] for name, comparison in self.comparisons.items()}

    @property
    def doubts(self) -> tuple[str, ...]:
        """What keeps parts from being printed as they are planned."""
        return tuple(f"{name}: {run.why_not}" for name, run in self.runs.items() if run.why_not)

    @property
    def table(self) -> Table:
        """Fibre, plastic and time of each part, of what is beside them, and in all."""
        totals, runs = self.print_totals, self.runs
        rows: list[Row] = []
        left = [totals.fibre_fed * 1e-3, totals.fibre_mass, totals.matrix_mass, totals.seconds]
        whole = list(left)
        for part in totals.parts:
            run, counted = runs[part.name], f"{part.count} x " * (part.count > 1)
            takes = [part.fibre, part.fibre_mass, part.matrix_mass, part.seconds]
            left = [before - taken for before, taken in zip(left, takes, strict=True)]
            ratio = headline_values(run).get("stiffness_ratio_tension")
            strands = 0 if run.strands is None else part.count * len(run.strands.fibre)
            about = (
                Cell(run.strategy_name),
                Cell("yes" if run.printable else "no", bad=not run.printable),
                Cell("–" if ratio is None else f"{ratio:.2f}"),
                Cell(f"{strands}"),
            )
            rows.append((f"{counted}{part.name}", (*about, *_amounts(takes)), ""))
        nothing = (Cell("–"),) * 4
        rows.append(("changes of tools, block, skirt", (*nothing, *_amounts(left)), ""))
        rows.append(("in all", (*nothing, *_amounts(whole)), ""))
        return Table(tuple(Head(*head) for head in _HEADS), tuple(rows))


_HEADS = (
    ("strategy", "Plans the fibre of the part."),
    ("printable", "Whether the paths of the part keep all limits of the machine."),
    ("stiffness ratio", "Of one part with fibre over one without, fibres carrying tension only."),
    ("strands", "Of all parts of this kind."),
    ("fibre, m", "That is fed."),
    ("fibre, g", "That is fed."),
    ("plastic, g", "That is fed, with pads and support."),
    ("time", "Of lines and strands, with the ways to them; of all with waits for tools."),
)


def _amounts(values: Sequence[float]) -> tuple[Cell, ...]:
    """Cells of fibre in m and g, plastic in g, and seconds."""
    metres, fibre, plastic, seconds = (max(value, 0.0) for value in values)
    texts = (f"{metres:.2f}", f"{fibre:.2f}", f"{plastic:.2f}", clock(seconds))
    return tuple(Cell(t, value=v) for t, v in zip(texts, values, strict=True))


def print_together(
    requests: Sequence[Request], course: Course = WITHOUT_HALT, progress: Progress = silent
) -> BedPrint:
    """Plan parts, each as it is asked for, and print all of them in one file.

    Where each part stands, and how often, its case says (`Case.bed`). Strands are planned, judged
    and tested part by part, as they are printed.

    Parameters
    ----------
    requests : sequence of Request
        Of one strategy and one slicing each; the machine is the same but for the height of layers.
    course : Course
        Where the file begins and halts.

    Raises
    ------
    InputError
        As `ccfem.compare`; for requests of several strategies or of different machines, for parts
        that cannot be printed, and where they do not fit on the bed.
    SolveError
        As `ccfem.compare`.
    """
    named = _named(requests)
    names, layouts = list(named), [request.case.bed for request in named.values()]
    machine = _only_machine(named)
    _check_known(named, machine)
    comparisons, plans = {}, []
    for k, (name, request) in enumerate(named.items()):
        comparison = answer(_alone(request), _share(progress, k, len(named) + 1))
        run = comparison.runs[0]
        if run.failure or run.unprinted or run.print_plan is None:
            raise InputError(f"{name}: {run.failure or run.unprinted or 'it has no print plan'}")
        plans.append(run.print_plan)
        comparisons[name] = replace(comparison, runs=(replace(run, moves=None),))
    progress("printing all together", len(named) / (len(named) + 1))
    plan = on_course(arranged(plans, layouts, machine, names), course, machine)
    moves = part_moves(plan, machine)
    totals = print_totals(moves, machine, plan.standing)
    plan = replace(plan, warnings=(*plan.warnings, *totals.words))
    return BedPrint(comparisons, machine, plan, moves, totals)


def needs_support(request: Request) -> bool:
    """Whether anything of a part would be laid in air; taken for granted of curved layers."""
    case = request.case
    layers = case.known_layers(request.only_slicer)
    return not layers or bool(in_air(case.problem.mesh, case.machine, layers))


def _named(requests: Sequence[Request]) -> dict[str, Request]:
    """Name requests as their cases; each is of one strategy on one slicing."""
    if not requests:
        raise InputError("name at least one part to print; got none")
    named: dict[str, Request] = {}
    for request in requests:
        if len(request.strategies) != 1 or request.named:
            raise InputError(
                f"a part of a print needs one strategy and one slicing; {request.case.name} has "
                f"{len(request.strategies)} and {len(request.slicings)}: name one"
            )
        if request.course:
            raise InputError("pauses and a first layer are of the whole print: give them to it")
        named[free_name(request.case.name, set(named))] = request
    return named


def _only_machine(named: Mapping[str, Request]) -> Machine:
    """Machine of all parts."""
    (first, request), *others = named.items()
    machine = request.case.machine
    for name, other in others:
        for field in dataclasses.fields(Machine):
            ours, theirs = (getattr(m, field.name) for m in (machine, other.case.machine))
            if field.name not in _OWN and ours != theirs:
                raise InputError(
                    f"one machine prints all parts of a file, but machine.{field.name} is not the "
                    f"same for {first} and {name}: choose it with --machine or --set-machine"
                )
    return machine


def _alone(request: Request) -> Request:
    """Request of one part in the middle of the bed, with its print."""
    bed = BedLayout(request.case.bed.spin)
    return replace(request, case=replace(request.case, bed=bed), print_plans=True)


def _check_known(named: Mapping[str, Request], machine: Machine) -> None:
    """Refuse layers that cannot be cut, and parts that do not fit on the bed, before any solve."""
    for request in named.values():
        check_slicings(request)
    cases = [request.case for request in named.values()]
    stacks = [request.case.known_layers(request.only_slicer) for request in named.values()]
    if all(stacks):
        builds = [stack[0].plane.frame[2].tolist() for stack in stacks]
        meshes = [case.problem.mesh for case in cases]
        check_room(meshes, builds, [case.bed for case in cases], machine, [*named])


def _share(progress: Progress, k: int, count: int) -> Progress:
    """Progress of one of several pieces of work."""
    return lambda what, share: progress(what, (k + share) / count)
