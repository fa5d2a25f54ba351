"""What ``ccfem front`` does: stiffness and strength over the length of fibre, in a folder."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.cli.arguments import numbers_of, parameters_by_strategy
from ccfem.cli.machines import MachineName, SetMachine
from ccfem.cli.options import Backend, CasePath, Force, LoadCase, Out, SetCase, SetOfOne, Strategy
from ccfem.cli.part_choices import SetFibre, SetPlastic

if TYPE_CHECKING:
    from ccfem.comparison.front_points import FibreFront

_FILES = ("front.csv", "front.png", "trade.png", "command.txt")
"""All files that the command writes."""


def front(
    case: CasePath,
    strategy: Strategy = "stream_function",
    set_: SetOfOne = None,
    set_case: SetCase = None,
    layers: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,..",
            help="Numbers of fibre layers; default the part's own, and twice as many where a "
            "strand has room in layers half as high.",
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(metavar="N", help="Lengths of fibre, up to what fills most layers.")
    ] = 5,
    strength: Annotated[
        str | None,
        typer.Option(
            metavar="W,W,..",
            help="Also plan for the load at first failure, which counts so much of 1 beside the "
            "stiffness, as 0,0.25,0.5; trade.png shows what one costs in the other.",
        ),
    ] = None,
    load_case: LoadCase = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_fibre: SetFibre = None,
    set_plastic: SetPlastic = None,
    backend: Backend = "auto",
    out: Out = None,
    force: Force = False,
) -> None:
    """Show how stiff and strong a part gets with how much fibre, beside what no paths exceed."""
    from ccfem.base.csv_table import write_csv
    from ccfem.base.errors import InputError, spared
    from ccfem.base.progress import progress_bar
    from ccfem.base.result_folder import whole_folder
    from ccfem.cli.run import load
    from ccfem.comparison.fibre_front import front_of
    from ccfem.comparison.request import Request, named_strategies

    parameters = parameters_by_strategy(set_ or (), strategy)
    counts = None if layers is None else numbers_of(layers)
    if counts is not None and not all(count.is_integer() for count in counts):
        raise InputError(f"--layers expects whole numbers as 6,12; got '{layers}'")
    strengths = () if strength is None else numbers_of(strength)
    if strength is not None and not strengths:
        raise InputError(f"--strength expects numbers from 0 to 1 as 0,0.25,0.5; got '{strength}'")
    part = load(case, set_case, False, machine, set_machine, set_fibre, set_plastic=set_plastic)
    chosen = named_strategies(part, (strategy,), parameters)
    request = Request(part, chosen, load_case=load_case, backend=backend)
    where = out if out is not None else Path("results") / f"{part.name}-front"
    with whole_folder(where, _FILES, force) as folder, progress_bar(lines=True) as progress:
        numbers = None if counts is None else [int(count) for count in counts]
        fibre_front = front_of(request, numbers, points, strengths, progress)
        frame = fibre_front.to_frame()
        write_csv(folder / "front.csv", [*frame], frame.itertuples(index=False))
        with spared("front.png", []):
            fibre_front.plot().savefig(folder / "front.png")
        if len(strengths) > 1:
            with spared("trade.png", []):
                fibre_front.plot_trade().savefig(folder / "trade.png")
        command = shlex.join(["ccfem", *sys.argv[1:]])
        (folder / "command.txt").write_text(command + "\n", encoding="utf-8")
    _say(fibre_front)
    for line in dict.fromkeys(fibre_front.findings):
        print(f"warning: {line}")
    drawn = [f"{name}, " for name in ("front.png", "trade.png") if (where / name).exists()]
    print(f"\n{where}: {''.join(drawn)}front.csv")


def _say(fibre_front: "FibreFront") -> None:
    """Print a table: the part without fibre, then the plans; marked are those of the fronts."""
    from ccfem.cli.front_table import front_table
    from ccfem.paths.planning.equal_fibre import TOLERANCE

    print("\n".join(front_table(fibre_front)))
    for count, reason in fibre_front.refused.items():
        print(f"{count:>6} no plan: {reason}")
    if fibre_front.stiffest.any():
        print("* none with as little fibre is better. One of them again:")
    else:
        print("None can be printed as planned. The one with most fibre again:")
    best = max(
        (
            point
            for point, kept in zip(fibre_front.points, fibre_front.stiffest.tolist(), strict=True)
            if kept
        ),
        key=lambda point: point.least_ratio,
        default=fibre_front.points[-1],
    )
    weight = f" --set strength={best.strength:g}" if best.strength else ""
    loads = " --load-case all" if fibre_front.cases_bounds else ""
    print(
        f"ccfem plan ...{loads} --strategy {fibre_front.strategy} --layers {best.layers} "
        f"--fibre-per-layer {best.asked:.0f}{weight}"
    )
    length = best.length_per_layer
    if length < (1.0 - TOLERANCE) * best.asked:
        print(
            f"of which it lays {length:.0f} mm a layer, its most, as that plan will say; asked for "
            f"{length:.0f} it may lay less"
        )
