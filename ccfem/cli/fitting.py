"""What ``ccfem calibrate`` does: from curves of printed parts to a material."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError
from ccfem.base.whole import check_writable
from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.comparison.request import named_strategies
from ccfem.fem.elasticity.plausibility import about_problem
from ccfem.judging.virtual_testing.calibration import calibrate, read_curve


def fit_material(
    read: Callable[[], Case],
    unreinforced: Path,
    reinforced: Path | None,
    strategy: str | None,
    parameters: Mapping[str, Mapping[str, Any]],
    options: Mapping[str, Any],
    out: Path,
) -> None:
    """Fit a material to force-displacement curves, write it, and say what was found.

    Parameters
    ----------
    read : callable
        Returns the part as it was printed; called when all files have been looked at.
    unreinforced, reinforced : Path
        Curves without and with fibre.
    strategy : str, optional
        That planned the reinforced part.
    parameters : mapping of strategy name to parameters
    options : mapping
        Keyword arguments of `ccfem.compare`.
    """
    curves = [curve.resolve() for curve in (unreinforced, reinforced) if curve is not None]
    if out.resolve() in curves:
        raise InputError(f"--out {out} is the curve of a test: name another file for the material")
    check_writable(out)
    without = read_curve(unreinforced)
    with_fibre = None if reinforced is None else read_curve(reinforced)
    if (reinforced is None) != (strategy is None):
        raise InputError("--reinforced and --strategy belong together; got only one of them")
    case, paths = read(), None
    if strategy is not None:
        chosen = named_strategies(case, (strategy,), parameters)
        (planned,) = compare(case, chosen, **options).runs
        if not len(planned.toolpaths):
            raise InputError(f"{strategy} could not plan the part: {planned.failure}")
        paths = planned.toolpaths
    for line in (*case.findings, *about_problem(case.problem)):
        print(f"warning: {line}")
    calibration = calibrate(
        case.printed_problem(), without, with_fibre, paths, options["load_case"], out.stem
    )
    calibration.write(out)
    rho = "" if calibration.rho is None else f", rho {calibration.rho:.3g} mm^2"
    print(
        f"{out}: modulus {calibration.modulus:.4g} MPa, "
        f"matrix strength {calibration.tensile_strength:.3g} MPa"
        f"{rho}; use it with --calibration {out}"
    )
