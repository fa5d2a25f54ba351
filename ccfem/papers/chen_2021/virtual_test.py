"""Virtual tests of the authors' own paths for the Loop, beside their physical tests.

    CCFEM_CHEN2021=folder python -m ccfem.papers.chen_2021.virtual_test

The authors printed and pulled one Loop without fibre, one with zigzag-contour paths and one with
their own. Stiffness ratios of the physical tests are slopes read from their force-displacement
curves; loads at failure are the peaks. The layers of Table 2 (the first 12 of the files) are
spread evenly over the height of 10 mm.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import from_voigt, strain_from_voigt, to_voigt
from ccfem.fem.elasticity import Problem, StressField, solve
from ccfem.fem.elasticity.problem import Bearing
from ccfem.fem.materials import Material, named_material
from ccfem.judging.virtual_testing.equilibrium import bar_stiffness
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import (
    FIRST,
    HONEST_PROMISE,
    SECOND,
    stiffer,
    virtual_bracket,
    virtual_test,
)
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.papers.chen_2021.authors import PATHS
from ccfem.papers.chen_2021.loop import LAYERS_TABLE_2, authors_folder, authors_loop
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.waypoints import read_waypoints

PHYSICAL = (1.79, 2.69, 1.50)
"""Measured zigzag/none, ours/none, ours/zigzag."""

MATRIX_STRENGTH = 33.0
"""Von Mises strength of the printed matrix, MPa, from the part without fibre."""

_PEAKS = {"none": 3.13, "zigzag": 3.64, "ours": 6.24}
"""Measured loads at failure, kN."""

_FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes of the tool, X, Y and Z, in the frame of the mesh."""


def authors_paths(name: str, layers: int = LAYERS_TABLE_2) -> Toolpaths:
    """Paths of the authors' first `layers` layers, "ours" or "zigzag", evenly over the height."""
    return spread_paths(authors_folder() / "Loop" / PATHS[name], layers)


def spread_paths(file: Path, layers: int, height: float = 10.0) -> Toolpaths:
    """Read the first layers of a file of the authors, spread evenly over a height, mm."""
    paths = read_waypoints(file, _FRAME)
    paths = paths.select(paths.layer < layers)
    points = np.array(paths.points)
    points[:, 1] = (np.repeat(paths.layer, np.diff(paths.offsets)) + 0.5) * height / layers
    return replace(paths, points=points)


def ratios(
    specimen: Specimen, strands: dict[str, Strands], rho: float, mode: str
) -> tuple[float, float, float]:
    """Stiffness zigzag/none, ours/none and ours/zigzag."""
    zigzag, ours = (
        virtual_test(strands[name], specimen, Strand(rho), mode, span=()).ratio
        for name in ("zigzag", "ours")
    )
    return zigzag, ours, ours / zigzag


# Oriented stiffness: fibres smeared over the cells, instead of bars in them.
#
# The stiffness of a transversely isotropic material is linear in ``a a`` and ``a a a a`` of its
# fibre direction a (Spencer, Continuum Theory of the Mechanics of Fibre-Reinforced Composites,
# 1984):
#
# stress = lam tr(e) I + 2 muT e + al (a.e a I + tr(e) aa) + 2 (muL - muT)(aa e + e aa) + be (a.e a)
# aa
#
# so that averages of the two over the fibre of a cell are all that is needed, and the sign of a
# never counts. Fibre and matrix are mixed by volume (Voigt's bound).


def fibre_share(strands: Strands, volumes: FloatArray, area: float) -> FloatArray:
    """Share of each cell's volume that is fibre, (m,), in [0, 1].

    Parameters
    ----------
    volumes : (m,) array, mm^3
    area : float, mm^2
        Cross-section of a strand. Where strands overlap the share is clipped at 1.
    """
    length = np.bincount(strands.cell, strands.length, len(volumes))
    return np.minimum(length * area / volumes, 1.0)


def oriented_stiffness(fourth: FloatArray, fibre: Material) -> FloatArray:
    """Stiffness of a transversely isotropic material averaged over fibre directions, MPa.

    Parameters
    ----------
    fourth : (..., 6, 6) array
        Average of ``m m^T`` with ``m = (ax^2, ay^2, az^2, ay az, ax az, ax ay)``: one direction,
        or a distribution of them; the first three rows sum up to the average of ``a a``.
    fibre : Material
        Fibre along axis 1.

    Returns
    -------
    (..., 6, 6) array, MPa
    """
    c = fibre.stiffness
    transverse, along = c[3, 3], c[4, 4]
    same = [c[0, 1] - c[0, 2], c[1, 1] - c[2, 2], along - c[5, 5], c[1, 1] - c[1, 2] - 2 * c[3, 3]]
    lame, alpha = c[1, 2], c[0, 1] - c[1, 2]
    beta = c[0, 0] + lame + 2.0 * transverse - 2.0 * c[0, 1] - 4.0 * along
    unit = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    if np.abs(same).max() > 1e-6 * np.abs(c).max():
        raise InputError(
            f"material '{fibre.name}' must be transversely isotropic about axis 1 to be smeared; "
            "it is not: make it with materials.transversely_isotropic"
        )
    second = fourth[..., :3, :].sum(axis=-2)
    tensor = from_voigt(second)
    both = np.stack(
        [to_voigt(tensor @ strain + strain @ tensor) for strain in strain_from_voigt(np.eye(6))],
        axis=-1,
    )
    isotropic = lame * np.outer(unit, unit) + transverse * np.diag(1.0 + unit)
    crossed = second[..., :, None] * unit + unit[:, None] * second[..., None, :]
    return isotropic + alpha * crossed + 2.0 * (along - transverse) * both + beta * fourth


def oriented_problem(problem: Problem, strands: Strands, fibre: Material, area: float) -> Problem:
    """Return the problem with the stiffness of fibre and matrix mixed in each cell.

    Parameters
    ----------
    problem : Problem
        Without fibres.
    fibre : Material
        Transversely isotropic, fibre along axis 1.
    area : float, mm^2
        Cross-section of a strand, for example `Machine.filament_area`.

    Returns
    -------
    Problem
        Solve it as any other: `ccfem.fem.elasticity.statics.solve`.
    """
    volumes = problem.mesh.volumes
    share = fibre_share(strands, volumes, area)
    length = np.bincount(strands.cell, strands.length, len(volumes))
    fourth = bar_stiffness(strands, volumes) * volumes[:, None, None]
    held = share > 0.0
    stiffness = np.array(np.broadcast_to(problem.cell_stiffness, (len(volumes), 6, 6)))
    smeared = oriented_stiffness(fourth[held] / length[held, None, None], fibre)
    stiffness[held] += share[held, None, None] * (smeared - stiffness[held])
    return replace(problem, stiffness=stiffness)


def oriented_ratio(
    strands: Strands, part: StressField, fibre: Material, area: float
) -> tuple[float, StressField]:
    """Stiffness with smeared fibres over that of the part without, and the solution.

    The smeared counterpart of the bonded virtual test; its stress is the mean of fibre and matrix.

    Parameters
    ----------
    part : StressField
        The part without fibres.
    area : float, mm^2
        Cross-section of a strand.
    """
    smeared = oriented_problem(part.problem, strands, fibre, area)
    smeared = replace(smeared, loads={part.case: smeared.loads[part.case]})
    after = solve(smeared)[part.case]
    specimen = Specimen.of(part)
    before = specimen.stiffness(part.displacement, part.strain_energy)
    return specimen.stiffness(after.displacement, after.strain_energy) / before, after


def main() -> None:
    """Print the ratios and first-failure loads beside the physical ones."""
    case = authors_loop()
    field = solve(case.problem)["pull"]
    specimen = Specimen.of(field)
    strands = {name: cut_strands(authors_paths(name), field.mesh) for name in ("zigzag", "ours")}
    print("Loop, stiffness:             zigzag/none  ours/none  ours/zigzag")
    print("physical, one specimen each       {:6.2f}     {:6.2f}       {:6.2f}".format(*PHYSICAL))
    for mode in ("bonded", "tension"):
        for rho in (2.15, 2.25, 4.0, 4.25):
            triple = ratios(specimen, strands, rho, mode)
            text = "{:6.3f}     {:6.3f}       {:6.3f}".format(*triple)
            print(f"{mode:8} rho {rho:4.2f} mm^2          {text}")

    carbon, area = named_material("c_fram"), case.machine.filament_area
    smeared = [oriented_ratio(strands[name], field, carbon, area)[0] for name in strands]
    text = "{:6.3f}     {:6.3f}       {:6.3f}".format(*smeared, smeared[1] / smeared[0])
    rho = area / np.linalg.inv(carbon.stiffness)[0, 0] / specimen.modulus
    print(f"smeared  rho {rho:4.2f} mm^2          {text}")

    print(
        "\nfirst failure, kN (tension only, rho 4, one matrix strength): predicted, measured peak"
    )
    index, _ = matrix_peak(field)
    print(f"none    {MATRIX_STRENGTH / index:5.2f} {_PEAKS['none']:5.2f}  in the matrix")
    brackets = {}
    for name in ("zigzag", "ours"):
        brackets[name] = virtual_bracket(strands[name], specimen, span=())
        failure = first_failure(brackets[name].tension, matrix_strength=MATRIX_STRENGTH)
        print(f"{name:7} {1e-3 * failure.load:5.2f} {_PEAKS[name]:5.2f}  in the {failure.what}")
    names = {FIRST: "ours", SECOND: "zigzag"}
    verdict = stiffer(brackets["ours"], brackets["zigzag"])
    print(f"stiffer: {names.get(verdict, verdict)}")

    bearing = replace(case.problem, loads={"bearing": (Bearing("load", (0.0, 0.0, 1000.0)),)})
    pressed = virtual_test(strands["ours"], solve(bearing)["bearing"], span=())
    print(f"ours/none under a bearing load on the same hole, rho 4, tension: {pressed.ratio:.3f}")
    print(f"\n{HONEST_PROMISE}")


if __name__ == "__main__":
    main()
