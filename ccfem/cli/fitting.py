"""What ``ccfem calibrate`` does: from curves of printed parts to a material."""

from collections.abc import Callable
from pathlib import Path

from ccfem.base.errors import InputError
from ccfem.base.whole import check_writable
from ccfem.cases.case import Case
from ccfem.comparison.engine import answer
from ccfem.comparison.request import Request
from ccfem.fem.elasticity.plausibility import about_problem
from ccfem.judging.virtual_testing.calibration import calibrate, read_curve


def fit_material(
    read: Callable[[], Case],
    unreinforced: Path,
    reinforced: Path | None,
    ask: Callable[[Case], Request] | None,
    load_case: str | None,
    out: Path,
) -> None:
    """Fit a material to force-displacement curves, write it, and say what was found.

    Parameters
    ----------
    read : callable
        Returns the part as it was printed; called when all files have been looked at.
    unreinforced, reinforced : Path
        Curves without and with fibre.
    ask : callable, optional
        Asks for the plan of the reinforced part.
    """
    curves = [curve.resolve() for curve in (unreinforced, reinforced) if curve is not None]
    if out.resolve() in curves:
        raise InputError(f"--out {out} is the curve of a test: name another file for the material")
    check_writable(out)
    without = read_curve(unreinforced)
    with_fibre = None if reinforced is None else read_curve(reinforced)
    if (reinforced is None) != (ask is None):
        raise InputError("--reinforced and --strategy belong together; got only one of them")
    case, paths = read(), None
    if ask is not None:
        (planned,) = answer(ask(case)).runs
        if not len(planned.toolpaths):
            raise InputError(f"{planned.name} could not plan the part: {planned.failure}")
        paths = planned.toolpaths
    for line in (*case.findings, *about_problem(case.problem)):
        print(f"warning: {line}")
    problem = case.printed_problem()
    calibration = calibrate(problem, without, with_fibre, paths, load_case, out.stem)
    calibration.write(out)
    rho = "" if calibration.rho is None else f", rho {calibration.rho:.3g} mm^2"
    print(
        f"{out}: modulus {calibration.modulus:.4g} MPa, "
        f"matrix strength {calibration.tensile_strength:.3g} MPa"
        f"{rho}; use it with --calibration {out}"
    )
