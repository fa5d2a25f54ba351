"""The result of a solve, stress from elsewhere in its place, and weighted load cases."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief, read_only
from ccfem.base.checks import check_known, check_number
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.base.tensor import strain_from_voigt, to_voigt
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import shape_values
from ccfem.fem.elasticity import support_kinds
from ccfem.fem.elasticity.error_estimate import ErrorEstimate, estimate_error
from ccfem.fem.elasticity.load_kinds import patches_in_use
from ccfem.fem.elasticity.loads import free_strain
from ccfem.fem.elasticity.nodes import edge_nodes, nearest_node, nearest_nodes, patch_nodes
from ccfem.fem.elasticity.plausibility import about_problem, about_solution
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import cell_strain, nodal_stress
from ccfem.fem.elasticity.supports import held
from ccfem.fem.materials import Material
from ccfem.geometry.locate import locate

# Stress of a whole part for planning and evaluation, whatever its source.


LARGEST_STRESS = 1e7
"""Largest stress that is taken for meant, MPa: ten times the modulus of diamond."""


def impossible_stress(stress: FloatArray) -> tuple[int, ...] | None:
    """Index of the first entry that is NaN, infinite or beyond `LARGEST_STRESS`; None without."""
    wrong = np.argwhere(~(np.abs(stress) <= LARGEST_STRESS))
    return tuple(wrong[0].tolist()) if len(wrong) else None


class PartStress(Protocol):
    """Stress on a tetrahedral mesh; a `StressField` is one, and so is a `GivenStress`."""

    @property
    def mesh(self) -> TetMesh:
        """The mesh."""
        ...

    @property
    def stress(self) -> FloatArray:
        """Stress of each cell, (m, 3, 3), MPa."""
        ...

    @property
    def nodal(self) -> FloatArray:
        """Stress at the nodes, (n, 3, 3), MPa."""
        ...

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load."""
        ...

    @property
    def loaded(self) -> tuple[str, ...]:
        """Those of them that carry a load."""
        ...

    @property
    def material(self) -> Material | None:
        """Material of the part; None where only its stress is known."""
        ...


@dataclass(frozen=True)
class GivenStress:
    """Stress on a mesh from another program or a formula.

    Attributes
    ----------
    stress : (m, 3, 3) array, MPa
        Per cell.
    nodal : (n, 3, 3) array, MPa
        At the nodes.
    held_or_loaded : tuple of str, default none
        Names of the patches that carry a support or a load.
    loaded : tuple of str, default none
        Those of them that carry a load.
    material : Material, optional
        Of the part, where it is known.
    assumed : str, default none
        What was assumed when it was read from a file; said with the results.

    Raises
    ------
    InputError
        For arrays of the wrong shape, and stress that is not finite or beyond `LARGEST_STRESS`.
    """

    mesh: TetMesh
    stress: FloatArray
    nodal: FloatArray
    held_or_loaded: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    material: Material | None = None
    assumed: str = ""

    def __repr__(self) -> str:
        return f"GivenStress on {self.mesh!r}"

    def __post_init__(self) -> None:
        freeze(self, stress=float, nodal=float)
        for name, count in (("stress", len(self.mesh.cells)), ("nodal", len(self.mesh.points))):
            value = getattr(self, name)
            if value.shape != (count, 3, 3):
                raise InputError(
                    f"{name} must have shape ({count}, 3, 3), one tensor for each "
                    f"{'cell' if name == 'stress' else 'node'}; got {value.shape}: use "
                    "tensor.from_voigt for six components"
                )
            at = impossible_stress(value)
            if at is not None:
                raise InputError(
                    f"stress must be finite and within {LARGEST_STRESS:g} MPa; got "
                    f"{value[at]:g} at {name}[{', '.join(map(str, at))}]: correct it, or its unit"
                )


# Displacement, strain and stress at points, along lines and on patches; forces of supports.


@dataclass(frozen=True)
class Probe:
    """Results of a solution at points (k, 3), mm: displacement, mm, strain and stress, MPa.

    Shear entries of the strain tensor are half the engineering ones.
    """

    points: FloatArray
    displacement: FloatArray
    strain: FloatArray
    stress: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, points=float, displacement=float, strain=float, stress=float)

    @property
    def distance(self) -> FloatArray:
        """Length (k,) of the line through the points, from the first one, mm."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([np.zeros(min(1, len(self.points))), np.cumsum(steps)])


def located(mesh: TetMesh, points: FloatArray, tolerance: float) -> tuple[IntArray, FloatArray]:
    """Cell (k,) that holds each point (k, 3), and barycentric coordinates (k, 4) in it."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InputError(f"points must be finite and of shape (k, 3), mm; got {points.shape}")
    cell, weights = locate(mesh.points, mesh.corners, points, tolerance)
    if (cell < 0).any():
        first = int(np.flatnonzero(cell < 0)[0])
        raise InputError(
            f"stress is known in the part only; {int((cell < 0).sum())} of {len(cell)} points "
            f"lie outside, the first at {np.round(points[first], 6).tolist()}: check the frame"
        )
    return cell, weights


def displacement_at(
    mesh: TetMesh, displacement: FloatArray, cell: IntArray, weights: FloatArray
) -> FloatArray:
    """Displacement (k, 3), mm, at barycentric coordinates (k, 4) of cells (k,)."""
    values = weights
    if mesh.order == 2:
        values = shape_values(mesh.local_coordinates(cell, weights))
    return np.einsum("ka,kai->ki", values, displacement[mesh.cells[cell]])


def support_forces(problem: Problem, reactions: FloatArray) -> dict[str, FloatArray]:
    """Force (3,), N, of each support on the part, by the patch, edge or point that it holds.

    Where supports share a node, each component of the reactions (n, 3), N, is divided equally among
    those that hold it, so that all forces together are the total reaction.
    """
    mesh = problem.mesh
    holding = (
        holder for holder in problem.supports if not isinstance(holder, support_kinds.TiedPatch)
    )
    claims = [_claim(mesh, support) for support in holding]
    held = np.zeros(mesh.points.shape)
    for _, nodes, components in claims:
        held[np.ix_(nodes, components)] += 1.0
    share = np.divide(reactions, held, out=np.zeros_like(held), where=held > 0.0)
    forces: dict[str, FloatArray] = {}
    for label, nodes, components in claims:
        force = np.zeros(3)
        force[components] = share[np.ix_(nodes, components)].sum(axis=0)
        forces[label] = forces.get(label, np.zeros(3)) + force
    return forces


def _claim(mesh: TetMesh, support: support_kinds.AnySupport) -> tuple[str, IntArray, IntArray]:
    """Name of a support, its nodes, and the components that it may hold there."""
    turned = isinstance(support, support_kinds.RigidPatch | support_kinds.LocalSupport)
    turned |= isinstance(support, support_kinds.NodeSupport) and bool(support.axes)
    letters = "xyz" if turned else getattr(support, "components", "xyz")
    components = np.array([k for k in range(3) if "xyz"[k] in letters], dtype=np.int64)
    if isinstance(support, support_kinds.EdgeSupport):
        label = f"edge of {support.patches[0]} and {support.patches[1]}"
        return label, edge_nodes(mesh, support.patches), components
    if isinstance(support, support_kinds.NodeSupport):
        return support.name, nearest_nodes(mesh, support.points, "a support"), components
    if isinstance(support, support_kinds.PointSupport | support_kinds.PointSpring):
        node = nearest_node(mesh, support.point, "a support")
        at = ", ".join(f"{x:.6g}" for x in support.point)
        return f"point ({at})", np.array([node]), components
    return support.patch, patch_nodes(mesh, support.patch), components


@dataclass(frozen=True)
class SolveRecord:
    """How a solve went.

    Attributes
    ----------
    iterations : int
        0 for a direct solve.
    residual : float
        Relative residual ``|f - K u| / |f|`` over the free components.
    unknowns : int
        Free components of the displacement.
    backward_error : float
        ``|f - K u| / (|K| |u| + |f|)``: distance to the equations that u solves exactly.
    energy_error : float
        Bound of the energy norm of the solver's error, over that of u; NaN if not computed.
    error : float
        Estimated energy norm of the discretisation error, over that of the exact solution; NaN if
        not computed.
    order_because : str
        The order of the displacement that was chosen, and why, if it was left open.
    backend_because : str
        The rule that chose the backend, or why another backend replaced it.
    """

    backend: str
    iterations: int
    residual: float
    assembly_seconds: float
    solve_seconds: float
    unknowns: int
    backward_error: float = np.nan
    energy_error: float = np.nan
    error: float = np.nan
    order_because: str = ""
    backend_because: str = ""


@dataclass(frozen=True)
class StressField(Shown):
    """Displacement and stress of one load case.

    Attributes
    ----------
    case : str
        Name of the load case.
    displacement : (n, 3) array, mm
    stress : (m, 3, 3) array, MPa
        Per cell (P2: at the centroid).
    nodal : (n, 3, 3) array, MPa
        Recovered at the nodes: volume-weighted average of the cells round each.
    reactions : (n, 3) array, N
        Force that the supports put on the part; zero away from them.
    strain_energy : float, N mm
    """

    problem: Problem
    case: str
    displacement: FloatArray
    stress: FloatArray
    nodal: FloatArray
    reactions: FloatArray
    strain_energy: float
    record: SolveRecord

    def __post_init__(self) -> None:
        freeze(self, displacement=float, stress=float, nodal=float, reactions=float)

    def __getstate__(self) -> dict[str, object]:
        """State for another process, which sets up matrix and solver itself where it tests."""
        return {name: value for name, value in vars(self).items() if name != "equations"}

    def __repr__(self) -> str:
        largest = float(np.linalg.norm(self.displacement, axis=1).max())
        return (
            f"StressField of load case {self.case}: {len(self.stress):,} cells, largest "
            f"displacement {largest:.4g} mm, strain energy {self.strain_energy:.4g} N mm"
        )

    @property
    def mesh(self) -> TetMesh:
        """Mesh of the problem."""
        return self.problem.mesh

    @cached_property
    def error(self) -> ErrorEstimate:
        """Estimated error of the stress of each cell."""
        problem = self.problem
        stiffness = problem.cell_stiffness
        if problem.density is not None:
            stiffness = problem.density[:, None, None] * stiffness
        region = np.zeros(len(self.mesh.cells), dtype=np.int64)
        for number, (_, cells) in enumerate(problem.materials):
            region[cells] = number
        free = free_strain(problem, self.case)
        return estimate_error(self.mesh, self.displacement, stiffness, free, region)

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """Remarks on the part and its solution, one line each (`plausibility`)."""
        problem, cases = self.problem, self.problem.factors(self.case)
        error = None if np.isnan(self.record.error) else self.error
        solution = (self.displacement, self.stress, self.nodal, error)
        return (
            *about_problem(problem, held(problem), cases, self.record.error),
            *about_solution(problem, self.case, *solution),
        )

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load."""
        return self.problem.held_or_loaded

    @property
    def loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a load in its load case."""
        return patches_in_use((), {self.case: self.problem.loads_of(self.case)})

    @property
    def material(self) -> Material:
        """Material of the part, outside its regions."""
        return self.problem.material

    def at(self, points: FloatArray, tolerance: float = 1e-3) -> FloatArray:
        """Recovered stress at any points of the part.

        Parameters
        ----------
        points : (k, 3) array, mm
        tolerance : float, mm
            Points outside the mesh by no more than this take the stress of its surface.

        Returns
        -------
        (k, 3, 3) array, MPa
            Interpolated linearly between the corner nodes of the cell that holds each point.

        Raises
        ------
        InputError
            When a point lies further outside.
        """
        cell, weights = located(self.mesh, points, tolerance)
        return np.einsum("qk,qkij->qij", weights, self.nodal[self.mesh.corners[cell]])

    @cached_property
    def strain(self) -> FloatArray:
        """Strain tensor of each cell (P2: at the centroid), (m, 3, 3), with tensor shear."""
        return read_only(strain_from_voigt(cell_strain(self.mesh, self.displacement)))

    @cached_property
    def nodal_strain(self) -> FloatArray:
        """Strain at the nodes, (n, 3, 3), averaged like the stress."""
        engineering = nodal_stress(self.mesh, self.displacement, np.eye(6))
        return read_only(strain_from_voigt(to_voigt(engineering)))

    def probe(self, points: FloatArray, tolerance: float = 1e-3) -> Probe:
        """Displacement, recovered strain and stress at points (k, 3), mm.

        Tolerance, and error where a point lies further outside, as in `at`.
        """
        points = np.asarray(points, dtype=np.float64)
        mesh = self.mesh
        cell, weights = located(mesh, points, tolerance)
        corner = mesh.corners[cell]
        return Probe(
            points,
            displacement_at(mesh, self.displacement, cell, weights),
            np.einsum("qk,qkij->qij", weights, self.nodal_strain[corner]),
            np.einsum("qk,qkij->qij", weights, self.nodal[corner]),
        )

    def along(self, start: Sequence[float], end: Sequence[float], count: int = 101) -> Probe:
        """`probe` at `count` >= 2 points of the straight line between two points, mm, of the part.

        Its `distance` is measured from the start.
        """
        check_number("number of points of a line", count, at_least=2)
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        return self.probe(first + np.linspace(0.0, 1.0, count)[:, None] * (last - first))

    def on(self, patch: str) -> Probe:
        """Return the result of `probe` at the nodes of a patch."""
        nodes = patch_nodes(self.mesh, patch)
        strain, stress = self.nodal_strain[nodes], self.nodal[nodes]
        return Probe(self.mesh.points[nodes], self.displacement[nodes], strain, stress)

    @property
    def support_forces(self) -> dict[str, FloatArray]:
        """Force (3,), N, of each support on the part: see `ccfem.fem.elasticity.stress_field`."""
        return support_forces(self.problem, self.reactions)


def about_cells(field: StressField) -> str:
    """Say in one line which cells a solution uses, why, and what error they leave."""
    record, mesh = field.record, field.mesh
    why = f" ({record.order_because})" if record.order_because else ""
    kind = "linear" if mesh.order == 1 else "quadratic"
    error = "not estimated" if np.isnan(record.error) else f"{record.error:.1%} in energy norm"
    return f"{len(mesh.cells):,} {kind} cells{why}; error {error}"


def solved(stress: PartStress, purpose: str) -> StressField:
    """Return the stress as the result of a solve, for methods that must solve the part again.

    Raises
    ------
    InputError
        When the stress was given; `purpose` names what is then impossible.
    """
    if not isinstance(stress, StressField):
        raise InputError(
            f"{purpose} solves the part again and needs its problem; got stress without one: solve "
            "the part with ccfem.solve, or choose another strategy"
        )
    return stress


# Load cases of one part with weights, as the basis of planning for all of them.


@dataclass(frozen=True)
class WeightedCases:
    """Solutions of one part without fibre under one or several load cases, and their weights.

    The cases may belong to one problem or to several, such as with other supports, on one mesh.

    Attributes
    ----------
    fields : tuple of StressField
        One for each case, with different names.
    weights : (n,) array
        Of the cases: positive, scaled so that their sum is 1.
    """

    fields: tuple[StressField, ...]
    weights: FloatArray

    def __post_init__(self) -> None:
        freeze(self, fields=tuple, weights=float)
        if not self.fields or self.weights.shape != (len(self.fields),):
            raise InputError(
                f"expected load cases with a weight each; got {len(self.fields)} cases and "
                f"{self.weights.size} weights: give one a case"
            )
        for name, weight in zip(self.names, self.weights, strict=True):
            _check_weight(name, float(weight))
        repeated = {name for name in self.names if self.names.count(name) > 1}
        if repeated:
            raise InputError(f"two load cases are named '{min(repeated)}': rename one of them")
        for field in self.fields:
            self._check_case(field)
        object.__setattr__(self, "weights", read_only(self.weights / self.weights.sum()))

    def _check_case(self, field: StressField) -> None:
        first, mesh = self.fields[0].mesh, field.mesh
        same = mesh is first or (
            np.array_equal(mesh.cells, first.cells) and np.array_equal(mesh.points, first.points)
        )
        if not same:
            raise InputError(
                f"load case '{field.case}' is solved on another mesh than '{self.names[0]}': "
                "solve all cases on one"
            )

    @classmethod
    def of(
        cls,
        fields: "StressField | WeightedCases | Mapping[str, StressField]",
        weights: Mapping[str, float] | None = None,
    ) -> "WeightedCases":
        """Cases by name, as `ccfem.solve` returns them, with weights; one case is a list of one.

        Parameters
        ----------
        fields : StressField, WeightedCases, or mapping of name to StressField
            Weighted cases without other weights are returned as they are.
        weights : mapping of name to float, optional
            Positive; cases that are not named do not count. Default: all count equally.
        """
        if isinstance(fields, WeightedCases):
            if weights is None:
                return fields
            fields = dict(zip(fields.names, fields.fields, strict=True))
        if isinstance(fields, StressField):
            fields = {fields.case: fields}
        chosen = weights or dict.fromkeys(fields, 1.0)
        for name, weight in chosen.items():
            check_known("load case", name, fields)
            _check_weight(name, weight)
        return cls(tuple(fields[name] for name in chosen), np.array(list(chosen.values()), float))

    def __len__(self) -> int:
        return len(self.fields)

    def __repr__(self) -> str:
        parts = (f"{n} {w:.3g}" for n, w in zip(self.names, self.weights, strict=True))
        return f"WeightedCases({', '.join(parts)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return tuple(field.case for field in self.fields)

    @property
    def heaviest(self) -> StressField:
        """Case of the largest weight, the first one of several."""
        return self.fields[int(np.argmax(self.weights))]

    @property
    def mesh(self) -> TetMesh:
        """Mesh of all cases."""
        return self.fields[0].mesh


def _check_weight(name: str, weight: float) -> None:
    check_number(f"weight of load case '{name}'", weight, above=0.0)
