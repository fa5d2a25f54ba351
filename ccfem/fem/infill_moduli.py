"""How stiff and strong sparse infill is in the mean, by the pattern and density of its lines.

Lines and grid are thin walls: rules of mixture for what lies along a direction; for shear across
the walls of a grid their bending (Gibson and Ashby, Cellular Solids, 1997, chapter 4: a square
honeycomb). Lines that turn by 90 degrees from layer to layer stand on each other where they cross,
on the square of the density. The gyroid has power laws of the density. They are not those of a
sheet of even thickness, which is up to twice as stiff (DeValk and Lakes, Physica Status Solidi B
258, 2021): a nozzle lays lines of one width, so that walls are thin where they lean, and open where
they lie. All laws were found from, or held against, voxels of the lines as they are laid, by
``benchmarks/studies/infill_moduli.py``.
"""

import numpy as np

from ccfem.base.arrays import FloatArray


def infill_stiffness(infill: str, density: float, modulus: float, poisson: float) -> FloatArray:
    """Mean stiffness of infill: (6, 6), MPa, axis 3 across the layers, 1 and 2 along its pattern.

    Parameters
    ----------
    infill : {"lines", "grid", "gyroid"}
    density : float
        Share of the volume that is filled, 0.05 to 0.6.
    modulus, poisson : float
        Of the plastic: Young's modulus, MPa, and Poisson's ratio.
    """
    rho, shear = density, 0.5 / (1.0 + poisson)
    if infill == "lines":
        young = (0.5 * rho, 0.5 * rho, rho**2)
        sliding = (0.2 * rho**3, 0.2 * rho**3, 0.28 * rho**3)
        nu12, nu13 = 0.0, 0.5 * poisson
    elif infill == "grid":
        young = (0.5 * rho, 0.5 * rho, rho)
        sliding = (0.5 * rho * shear, 0.5 * rho * shear, rho**3 / 16.0)
        nu12, nu13 = 0.0, 0.5 * poisson
    else:
        young = (0.45 * rho**1.5, 0.45 * rho**1.5, 0.6 * rho**1.25)
        sliding = (0.225 * rho**1.3, 0.225 * rho**1.3, 0.2 * rho**1.45)
        nu12, nu13 = 0.5 - 0.3 * rho, 0.2
    compliance = np.diag([1.0 / x for x in (*young, *sliding)])
    compliance[0, 1] = compliance[1, 0] = -nu12 / young[0]
    compliance[:2, 2] = compliance[2, :2] = -nu13 / young[0]
    stiffness = modulus * np.linalg.inv(compliance)
    return np.asarray(0.5 * (stiffness + stiffness.T))


def infill_strength(stiffness: FloatArray, density: float, modulus: float) -> float:
    """Mean stress that infill bears, over the strength of its plastic.

    Under a mean stress s along an axis with Young's modulus E' infill stores ``s^2 / 2 E'``, all of
    it in the share `density` of its volume. The root mean square of the stress in its lines is
    therefore ``s sqrt(E / (density E'))``: it may not exceed the strength of the plastic, whose
    modulus is E. Of the three axes that of the least modulus counts.
    """
    least = 1.0 / float(np.diag(np.linalg.inv(stiffness))[:3].max())
    return float(np.sqrt(density * least / modulus))
