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
    names = () if fibre_front.points[0].cases is None else fibre_front.points[0].cases.names
    heads, bare = _of_cases(fibre_front, names) if names else _of_one(fibre_front)
    lines = [f"{'layers':>6}{'strength':>10}{'fibre, m':>10}{heads}"]
    lines.append(f"{'-':>6}{'-':>10}{0.0:>10.2f}{bare}")
    rows = zip(
        fibre_front.points,
        fibre_front.stiffest.tolist(),
        fibre_front.strongest.tolist(),
        strict=True,
    )
    for point, stiffest, strongest in rows:
        first = f"{point.layers:>6}{point.strength:>10g}{1e-3 * point.length:>10.2f}"
        marks = f"{'*' * stiffest:<1}", f"{'*' * strongest:<2}"
        cells = _row(point, *marks) if point.cases is None else _row_of_cases(point.cases, *marks)
        lines.append(first + cells + (f" not printable: {point.why_not}" if point.why_not else ""))
    return lines


def _of_one(fibre_front: "FibreFront") -> tuple[str, str]:
    """Heads, and cells of the part without fibre."""
    heads = f"{'stiffness':>11}{'bound':>8}{'first failure':>17}"
    return heads, f"{1.0:>10.3f} {1.0:>8.3f}{_newtons(fibre_front.bare):>15}"


def _row(point: "FrontPoint", stiffest: str, strongest: str) -> str:
    failure = _newtons(point.failure)
    bound = "-" if isnan(point.bound) else f"{point.bound:.3f}"
    return f"{point.ratio:>10.3f}{stiffest}{bound:>8}{failure:>15}{strongest}"


def _of_cases(fibre_front: "FibreFront", names: tuple[str, ...]) -> tuple[str, str]:
    """Heads, and cells of the part without fibre, under several load cases."""
    heads = "".join(f"{_head(name):>{_width(name)}}" for name in names)
    none = "".join(f"{_ratio(1.0, 1.0):>{_width(name)}}" for name in names)
    return (
        f"{'worst of bound':>16}{'at most':>9}{heads}  first failure",
        f"{1.0:>15.1%} {1.0:>9.1%}{none}  {_times(fibre_front.bare)}",
    )


def _row_of_cases(cases: "PointCases", stiffest: str, strongest: str) -> str:
    cells = "".join(
        f"{_ratio(ratio, most):>{_width(name)}}"
        for name, ratio, most in zip(
            cases.names, cases.ratios.tolist(), cases.bound.singles.tolist(), strict=True
        )
    )
    failure = _times(float(cases.factors.min()), cases.fails_first)
    share = f"{cases.share:>15.1%}{stiffest}{1.0 / cases.bound.least:>9.1%}"
    return f"{share}{cells}  {failure}{strongest}"


def _head(name: str) -> str:
    return f"{name} (bound)"


def _width(name: str) -> int:
    return max(len(_head(name)), len(_ratio(10.0, 10.0))) + 3


def _ratio(ratio: float, most: float) -> str:
    return f"{ratio:.3f} ({most:.3f})"


def _newtons(load: float) -> str:
    return f"{load:.0f} N" if load == load else "not known"


def _times(factor: float, case: str = "") -> str:
    if factor != factor:
        return "not known"
    return f"{factor:.3g} × {case or 'the load'}"
