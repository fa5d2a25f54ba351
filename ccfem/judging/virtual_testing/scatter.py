"""Scatter of a stiffness ratio: what moduli and places that differ from print to print do to it."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.recovery import nodal_stress
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.elasticity.supports import soft_supports, spring_forces
from ccfem.judging.virtual_testing.equilibrium import IN_COMPRESSION, bars
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.judging.virtual_testing.strands import Strands


@dataclass(frozen=True)
class Scatter:
    """How far prints of one design differ, in a part file ``[scatter]``.

    The first two are common to all strands of a print, and to all designs that are printed from the
    same spools; the others differ from strand to strand. What fibre in compression carries is not
    among them: the range of every stiffness ratio shows it.

    Attributes
    ----------
    fibre : float
        Coefficient of variation of a strand's axial stiffness EA: modulus, share of fibre and
        section together. Default: that of three moduli published for one kind of printed carbon
        strand, 60 GPa (Markforged data sheet), 73.2 (Plocher et al. 2022, table 5) and 85 (Saeed
        2021, abstract).
    matrix : float
        Coefficient of variation of the modulus of the matrix. Default assumed: that of 3.0 and 3.5
        GPa, the two moduli of printed PLA in the table of materials.
    strands : float
        The same as `fibre`, of one strand beside the others of its print. Default assumed.
    position : float, mm
        Standard deviation of a strand's place across itself, in its layer. Default assumed.
    """

    fibre: float = 0.17
    matrix: float = 0.11
    strands: float = 0.05
    position: float = 0.2

    def __post_init__(self) -> None:
        check_fields(self, "fibre", "matrix", "strands", at_least=0.0, below=1.0)
        check_fields(self, "position", at_least=0.0, at_most=5.0, unit="mm")


DEFAULT_SCATTER = Scatter()
"""The scatter where nothing is said of it."""


@dataclass(frozen=True)
class RatioScatter:
    """Scatter of one design's stiffness ratio, to first order.

    Attributes
    ----------
    given : Scatter
        Of the material and of the places of strands.
    fibre : float
        d ln(ratio) / d ln(EA): the share of the strain energy that is in the fibres.
    matrix : float
        d ln(ratio) / d ln(E): the share that is in the matrix, less that without fibre. It is
        ``-fibre`` where no springs hold the part.
    strands, position : float
        Standard deviation of ln(ratio) that the same two cause which differ from strand to strand.
    """

    given: Scatter
    fibre: float
    matrix: float
    strands: float
    position: float

    @property
    def independent(self) -> float:
        """Standard deviation of ln(ratio) by all that differs from strand to strand."""
        return float(np.hypot(self.strands, self.position))

    @property
    def deviation(self) -> float:
        """Standard deviation of ln(ratio), nearly that of the ratio over its mean."""
        common = (self.fibre * self.given.fibre, self.matrix * self.given.matrix)
        return float(np.linalg.norm([*common, self.independent]))

    def against(self, other: "RatioScatter") -> float:
        """Return the standard deviation of ln(stiffness over that of another design).

        Both are printed from the same spools: what they have in common acts by the difference of
        their sensitivities alone, and what differs from strand to strand adds up.
        """
        fibre = (self.fibre - other.fibre) * self.given.fibre
        matrix = (self.matrix - other.matrix) * self.given.matrix
        return float(np.linalg.norm([fibre, matrix, self.independent, other.independent]))


def ratio_scatter(
    test: VirtualTest,
    scatter: Scatter = DEFAULT_SCATTER,
    build: tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> RatioScatter:
    """Scatter of the stiffness ratio that a test found, without another solve.

    Compliance is its own adjoint: with the displacement kept, the strain energy changes by as much
    as the stiffness does, in shares of themselves. This holds under forces and under moving
    supports, and where strands carry tension only.

    Parameters
    ----------
    build : tuple of 3 floats
        Normal of the layers; strands move across themselves in the plane to which it is normal.
    """
    mesh, u = test.solution.problem.mesh, test.solution.displacement
    whole, strands = test.solution.strain_energy, test.strands
    fibre = test.fibre_energy / whole
    strain = bars(strands, mesh).strain(u)

    def energies(strain: FloatArray) -> FloatArray:
        """Energy of each strand (p,) at a strain of its pieces (s,), for EA = 2 N."""
        carried = np.where(strain > 0.0, 1.0, IN_COMPRESSION[test.mode])
        pieces = carried * strands.share * strands.length * strain**2
        return np.bincount(strands.path, pieces).astype(float)

    by_strand = energies(strain)
    total = float(by_strand.sum())
    slopes = np.zeros_like(by_strand)  # of the energies, by one standard deviation of the place
    if scatter.position > 0.0:
        change = _change_aside(strands, mesh, u, scatter.position, np.array(build))
        slopes = 0.5 * (energies(strain + change) - energies(strain - change))
    share = fibre / total if total > 0.0 else 0.0  # of an energy for EA = 2 N in that of the part
    return RatioScatter(
        scatter,
        fibre=fibre,
        matrix=_in_springs(test.unreinforced) - _in_springs(test.solution) - fibre,
        strands=scatter.strands * share * float(np.linalg.norm(by_strand)),
        position=share * float(np.linalg.norm(slopes)),
    )


def _in_springs(field: StressField) -> float:
    """Share of the strain energy that is in springs and beds that hold the part."""
    problem, u = field.problem, field.displacement
    soft = soft_supports(problem)
    if not soft:
        return 0.0
    return -0.5 * float(np.vdot(spring_forces(problem.mesh, soft, u), u)) / field.strain_energy


_TENSOR = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
"""Makes the components of a tensor of Voigt strain with engineering shear."""


def _change_aside(
    strands: Strands, mesh: TetMesh, displacement: FloatArray, distance: float, build: FloatArray
) -> FloatArray:
    """Change (s,) of the strain along pieces that move across themselves in their layer.

    The strain is averaged at the nodes and linear between them: that of linear cells itself does
    not change within a cell. Half of the change from one side to the other, as far as the part
    goes; a piece along the build direction stays in place.
    """
    across = np.cross(build, strands.tangent)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across *= distance / np.where(size > 0.0, size, 1.0)
    nodal = nodal_stress(mesh, displacement, _TENSOR)
    places = np.concatenate([strands.middle + across, strands.middle - across])
    cell, weights = mesh.locate(places)
    held = cell >= 0
    weights[~held] = 0.25
    reached = []
    for way in (slice(len(strands)), slice(len(strands), None)):
        at = np.where(held[way], cell[way], strands.cell)
        tensor = np.einsum("sa,saij->sij", weights[way], nodal[mesh.corners[at]])
        along = np.einsum("sij,si,sj->s", tensor, strands.tangent, strands.tangent)
        reached.append((along, held[way]))
    (ahead, inside), (behind, also) = reached
    return np.where(inside & also, 0.5 * (ahead - behind), 0.0)
