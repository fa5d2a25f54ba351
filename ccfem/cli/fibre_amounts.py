"""What ``ccfem front`` does: stiffness and strength over the length of fibre, in a folder."""

import shlex
import sys
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ccfem.cli import options
from ccfem.cli.arguments import numbers_of, option, parameters_by_strategy
from ccfem.cli.part_choices import PrintedPart

if TYPE_CHECKING:
    from ccfem.comparison.front_cases import PointCases
    from ccfem.comparison.front_points import FibreFront, FrontPoint

# The table of a front on the screen: a line a plan, for one load case or for several.


def front_table(fibre_front: "FibreFront") -> list[str]:
    """Lines of the table: the part without fibre, then the plans; marked are those of the fronts.

    With several load cases: the least share of its own bound that a case reaches, the share above
    which no paths bring the worst case, the stiffness ratio of each case with its bound, and the
    least multiple of its load at which one fails.
    """
    names = fibre_front.cases
    if not names:
        heads = ["stiffness ratio", "bound"]
        bare = ["1.000 ", "1.000", _newtons(fibre_front.bare)]
    else:
        heads = ["worst of bound", "at most", *(f"{name} (bound)" for name in names)]
        none = [_ratio(1.0, 1.0) for _ in names]
        bare = ["100.0% ", "100.0%", *none, _times(fibre_front.bare)]
    rows = [["layers", "strength", "fibre, m", *heads, "first failure"]]
    rows.append(["-", "-", "0.00", *bare])
    marks = zip(fibre_front.stiffest.tolist(), fibre_front.strongest.tolist(), strict=True)
    for point, (stiffest, strongest) in zip(fibre_front.points, marks, strict=True):
        cells = _row_of_cases(point.cases) if point.cases else _row(point)
        cells[0] += "*" if stiffest else " "
        cells[-1] += "*" if strongest else ""
        cells[-1] += f"  not printable: {point.why_not}" if point.why_not else ""
        metres = f"{1e-3 * point.length:.2f}"
        rows.append([f"{point.layers}", f"{point.strength:g}", metres, *cells])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([*(cell.rjust(w) for cell, w in zip(row[:-1], widths, strict=False)), row[-1]])
        for row in rows
    ]


def _row(point: "FrontPoint") -> list[str]:
    bound = "-" if isnan(point.bound) else f"{point.bound:.3f}"
    return [f"{point.ratio:.3f}", bound, _newtons(point.failure)]


def _row_of_cases(cases: "PointCases") -> list[str]:
    bounds = zip(cases.ratios.tolist(), cases.bound.singles.tolist(), strict=True)
    failure = _times(float(cases.factors.min()), cases.fails_first)
    shares = [f"{cases.share:.1%}", f"{1.0 / cases.bound.least:.1%}"]
    return [*shares, *(_ratio(ratio, most) for ratio, most in bounds), failure]


def _ratio(ratio: float, most: float) -> str:
    return f"{ratio:.3f} ({most:.3f})"


def _newtons(load: float) -> str:
    return f"{load:.0f} N" if load == load else "not known"


def _times(factor: float, case: str = "") -> str:
    if factor != factor:
        return "not known"
    return f"{factor:.3g} × {case or 'the load'}"


_FILES = ("front.csv", "front.png", "trade.png", "command.txt")
"""All files that the command writes."""


@options.grouped
def front(
    given: PrintedPart,
    strategy: options.Strategy = "stream_function",
    set_: options.SetOfOne = None,
    layers: Annotated[
        str | None,
        option(
            "N,N,..",
            "Numbers of fibre layers; default the part's own, and twice as many where a strand has "
            "room in layers half as high.",
        ),
    ] = None,
    points: Annotated[int, option("N", "Lengths of fibre, up to what fills most layers.")] = 5,
    strength: Annotated[
        str | None,
        option(
            "W,W,..",
            "Also plan for the load at first failure, which counts so much of 1 beside the "
            "stiffness, as 0,0.25,0.5; trade.png shows what one costs in the other.",
        ),
    ] = None,
    load_case: options.LoadCase = None,
    backend: options.Backend = "auto",
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Show how stiff and strong a part gets with how much fibre, beside what no paths exceed."""
    from ccfem.base.csv_table import write_csv
    from ccfem.base.errors import InputError, spared
    from ccfem.base.progress import progress_bar
    from ccfem.base.result_folder import whole_folder
    from ccfem.comparison.front_plans import front_of
    from ccfem.comparison.request import Request, named_strategies

    parameters = parameters_by_strategy(set_ or (), strategy)
    counts = None if layers is None else numbers_of(layers)
    if counts is not None and not all(count.is_integer() for count in counts):
        raise InputError(f"--layers expects whole numbers as 6,12; got '{layers}'")
    strengths = () if strength is None else numbers_of(strength)
    if strength is not None and not strengths:
        raise InputError(f"--strength expects numbers from 0 to 1 as 0,0.25,0.5; got '{strength}'")
    part = given.read()
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
