"""The table of a front on the screen: a line a plan, for one load case or for several."""

from math import isnan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ccfem.comparison.front_cases import PointCases
    from ccfem.comparison.front_points import FibreFront, FrontPoint


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
