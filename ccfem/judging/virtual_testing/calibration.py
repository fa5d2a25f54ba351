"""Calibration: modulus, strength and strand stiffness from force-displacement curves.

A test of the part printed without fibre gives Young's modulus and the strength of the matrix; one
more, of the same part printed with known fibre paths, gives rho = EA/E of a strand. Handbook
values are far off for printed parts, which deflect a lot and are not solid.
"""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from ccfem.base.checks import MODULUS, STRENGTH
from ccfem.base.errors import InputError
from ccfem.base.toml import from_table, read_toml
from ccfem.base.whole import existing_file, whole_file
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.materials import Material, isotropic
from ccfem.judging.virtual_testing.equilibrium import TENSION
from ccfem.judging.virtual_testing.force_displacement import Curve
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.judging.virtual_testing.strength import matrix_peak
from ccfem.judging.virtual_testing.virtual_test import virtual_test
from ccfem.paths.toolpaths import Toolpaths

_RANGE = (1e-3, 1e3)
"""Values of rho, mm^2, that are tried."""


@dataclass(frozen=True)
class Calibration:
    """What the tests of one part say about matrix and strand.

    Attributes
    ----------
    modulus : float, MPa
        Young's modulus of the printed matrix.
    poisson : float
        As assumed for the calibration.
    tensile_strength : float, MPa
        Of the matrix: von Mises stress, averaged over a ball, at which the part without fibre
        failed.
    rho : float or None, mm^2
        EA of a strand over the modulus; None without a reinforced test.
    source : str
        Which tests the numbers come from.
    """

    name: str
    modulus: float
    poisson: float
    tensile_strength: float
    rho: float | None = None
    source: str = ""

    @property
    def material(self) -> Material:
        """The matrix."""
        return isotropic(
            self.modulus, self.poisson, self.name, self.tensile_strength, source=self.source
        )

    def strand(self, default: Strand | None = None) -> Strand:
        """Return the strand: `default` (rho = 4) with the calibrated rho, where there is one."""
        default = default or Strand()
        return default if self.rho is None else replace(default, rho=self.rho)

    def write(self, path: str | Path) -> None:
        """Write a material file (TOML) that `read_calibration` reads."""
        lines = ["# Material calibrated on printed parts. Units: mm, N, MPa."]
        for key, value in vars(self).items():
            if value is not None:
                # JSON writes strings and numbers as TOML does, but for the delete character.
                text = json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
                lines.append(f"{key} = {text}")
        with whole_file(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def calibrate(
    problem: Problem,
    unreinforced: Curve,
    reinforced: Curve | None = None,
    toolpaths: Toolpaths | None = None,
    case: str | None = None,
    name: str = "calibrated",
) -> Calibration:
    """Fit matrix and strand to tests of one part, with fibres that carry tension only.

    Parameters
    ----------
    problem : Problem
        The part as tested; its modulus is only a starting point, its Poisson's ratio is kept. The
        material must be isotropic and the same everywhere.
    unreinforced : Curve
        Of the part without fibre. The displacement is taken as that of the load.
    reinforced : Curve, optional
        Of the same part with fibres.
    toolpaths : Toolpaths, optional
        Fibres in the reinforced part.
    case : str, optional
        Load case that stands for the test; needed where there are several.
    name : str
        Name of the material.

    Raises
    ------
    InputError
        For curves that do not suit each other or the part, rows that leave their curve, and values
        that no printed material has.
    """
    if (reinforced is None) != (toolpaths is None):
        raise InputError(
            "a reinforced test needs both its curve and its toolpaths; got only one of them"
        )
    slope = unreinforced.slope()
    stiffer = None if reinforced is None else reinforced.slope()
    field = _field(problem, case)
    specimen = Specimen.of(field)
    poisson = _poisson(problem)
    computed = specimen.stiffness(field.displacement, field.strain_energy)
    index, _ = matrix_peak(field)
    source = f"{unreinforced.name}: {slope:.4g} N/mm, peak {unreinforced.peak:.4g} N"
    result = Calibration(
        name=name,
        modulus=specimen.modulus * slope / computed,
        poisson=poisson,
        tensile_strength=index * unreinforced.peak / specimen.force(field.reactions),
        source=source,
    )
    for what, value, sizes in (
        ("modulus", result.modulus, MODULUS),
        ("strength", result.tensile_strength, STRENGTH),
    ):
        doubt = sizes.about(f"the {what} that follows", value)
        if doubt:
            raise InputError(
                f"{unreinforced.name}: {doubt.partition(': ')[0]}: check the units of the curve, "
                "mm and N unless its first line names others, and that the part is the tested one"
            )
    if reinforced is None or toolpaths is None or stiffer is None:
        return result
    rho = _fit_rho(specimen, toolpaths, stiffer / slope, reinforced.name)
    return replace(result, rho=rho, source=f"{source}; {reinforced.name}: {stiffer:.4g} N/mm")


def _field(problem: Problem, case: str | None) -> StressField:
    """Solution of the load case that stands for the test."""
    if case is None and len(problem.loads) == 1:
        case = next(iter(problem.loads))
    if case is None or case not in problem.loads:
        raise InputError(
            f"expected the load case of the test; got {case}: name one of "
            f"{', '.join(problem.loads)}"
        )
    alone = replace(problem, loads={case: problem.loads[case]}, combinations={})
    return solve(alone)[case]


def _poisson(problem: Problem) -> float:
    """Poisson's ratio of an isotropic part."""
    stiffness = problem.material.stiffness
    compliance = np.linalg.inv(stiffness)
    poisson = float(-compliance[0, 1] / compliance[0, 0])
    expected = isotropic(1.0 / compliance[0, 0], poisson).stiffness
    if (
        problem.stiffness is not None
        or problem.density is not None
        or not np.allclose(stiffness, expected, rtol=1e-6, atol=1e-6 * expected.max())
    ):
        raise InputError(
            "calibration fits one isotropic modulus; the part has an anisotropic or varying "
            "material: calibrate with an isotropic one"
        )
    return round(poisson, 12)


def _fit_rho(specimen: Specimen, toolpaths: Toolpaths, wanted: float, name: str) -> float:
    """Value of rho, mm^2, at which the virtual test gives the wanted stiffness ratio."""
    if not wanted > 1.0:
        raise InputError(
            f"{name}: the part with fibre is not stiffer than the one without ({wanted:.3g} times "
            "as stiff): check that the curves are not swapped and were measured alike"
        )
    strands = cut_strands(toolpaths, specimen.unreinforced.mesh)

    def excess(logarithm: float) -> float:
        strand = Strand(rho=math.exp(logarithm))
        return math.log(virtual_test(strands, specimen, strand, TENSION, span=()).ratio / wanted)

    # The ratio rises with rho: half of the range drops out by one test at the usual value.
    low, high = (math.log(rho) for rho in _RANGE)
    at = math.log(4.0)
    if excess(at) > 0.0:
        high = at
    else:
        low = at
    ends = excess(low), excess(high)
    if not ends[0] <= 0.0 <= ends[1]:
        raise InputError(
            f"{name}: no strand between rho = {_RANGE[0]:g} and {_RANGE[1]:g} mm^2 makes the part "
            f"{wanted:.3g} times as stiff: check that the toolpaths are those of the print"
        )
    return float(math.exp(brentq(excess, low, high, xtol=1e-4)))


def read_calibration(path: str | Path) -> Calibration:
    """Read a material file that `Calibration.write` wrote.

    Raises
    ------
    InputError
        When the file cannot be read, or its values are not those of a calibration.
    """
    path = existing_file(path, "material file")
    try:
        values = {"name": path.stem, **read_toml(path, "material file")}
        return from_table(Calibration, values, "material")
    except InputError as error:
        raise InputError(
            f"expected a material file at {path}; it cannot be read: {error}: write it by ccfem "
            "calibrate"
        ) from None
