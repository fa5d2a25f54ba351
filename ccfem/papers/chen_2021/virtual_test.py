"""Virtual tests of the authors' own paths for the Loop, beside their physical tests.

    CCFEM_CHEN2021=folder python -m ccfem.papers.chen_2021.virtual_test

The authors printed and pulled one Loop without fibre, one with zigzag-contour paths and one with
their own. Stiffness ratios of the physical tests are slopes read from their force-displacement
curves; loads at failure are the peaks. The layers of Table 2 (the first 12 of the files) are
spread evenly over the height of 10 mm.
"""

from dataclasses import replace

import numpy as np

from ccfem.fem.elasticity.problem import Bearing
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.materials import named_material
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffer import FIRST, HONEST_PROMISE, SECOND, stiffer
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.judging.virtual_testing.strength import first_failure, matrix_peak
from ccfem.judging.virtual_testing.virtual_test import virtual_bracket, virtual_test
from ccfem.papers.chen_2021.loop import LAYERS_TABLE_2, authors_folder, authors_loop
from ccfem.papers.chen_2021.oriented import oriented_ratio
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.waypoints import read_waypoints

PHYSICAL = (1.79, 2.69, 1.50)
"""Measured zigzag/none, ours/none, ours/zigzag."""

MATRIX_STRENGTH = 33.0
"""Von Mises strength of the printed matrix, MPa, from the part without fibre."""

_PEAKS = {"none": 3.13, "zigzag": 3.64, "ours": 6.24}
"""Measured loads at failure, kN."""

_HEIGHT = 10.0
_FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes of the tool, X, Y and Z, in the frame of the mesh."""

_FILES = {"zigzag": "GcodeGenerater_Zigzag_Contour_raw.txt", "ours": "GcodeGenerater_Ours_raw.txt"}


def authors_paths(name: str, layers: int = LAYERS_TABLE_2) -> Toolpaths:
    """Paths of the authors' first `layers` layers, "ours" or "zigzag", evenly over the height."""
    paths = read_waypoints(authors_folder() / "Loop" / _FILES[name], _FRAME)
    paths = paths.select(paths.layer < layers)
    points = np.array(paths.points)
    points[:, 1] = (np.repeat(paths.layer, np.diff(paths.offsets)) + 0.5) * _HEIGHT / layers
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


def main() -> None:
    """Print the ratios and first-failure loads beside the physical ones."""
    case = authors_loop()
    field = solve(case.problem)["pull"]
    specimen = Specimen.of(field)
    strands = {name: cut_strands(authors_paths(name), field.mesh) for name in _FILES}
    print("Loop, stiffness:             zigzag/none  ours/none  ours/zigzag")
    print("physical, one specimen each       {:6.2f}     {:6.2f}       {:6.2f}".format(*PHYSICAL))
    for mode in ("bonded", "tension"):
        for rho in (2.15, 2.25, 4.0, 4.25):
            found = ratios(specimen, strands, rho, mode)
            text = "{:6.3f}     {:6.3f}       {:6.3f}".format(*found)
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
    said = {FIRST: "ours", SECOND: "zigzag"}
    verdict = stiffer(brackets["ours"], brackets["zigzag"])
    print(f"stiffer: {said.get(verdict, verdict)}")

    bearing = replace(case.problem, loads={"bearing": (Bearing("load", (0.0, 0.0, 1000.0)),)})
    pressed = virtual_test(strands["ours"], solve(bearing)["bearing"], span=())
    print(f"ours/none under a bearing load on the same hole, rho 4, tension: {pressed.ratio:.3f}")
    print(f"\n{HONEST_PROMISE}")


if __name__ == "__main__":
    main()
