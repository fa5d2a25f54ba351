"""SIMP: densities of least compliance for a given volume, by optimality criteria."""

from collections.abc import Mapping
from dataclasses import dataclass

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.progress import Progress, silent
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.compliance import Compliance
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.iteration import iterate
from ccfem.fem.topopt.parameters import Parameters
from ccfem.fem.topopt.parametrisation import Parametrisation


@dataclass(frozen=True)
class Simp(Parameters):
    """Densities of least compliance with a given volume.

    Modified SIMP with optimality criteria (Andreassen et al., Struct. Multidisc. Optim. 43 (2011)
    1: the 88 lines), on plates and on linear tetrahedra alike.

    Attributes
    ----------
    volume_fraction : float in (0, 1)
        Of all cells, passive ones included.
    penalty : float, default 3
        Exponent of the density in the stiffness, at least 1.
    radius : float, mm, default 2.5
        Of the filter.
    filter : str, default "sensitivity"
        "sensitivity" or "density".
    minimum_stiffness : float in (0, 1), default 1e-9
        Share of the stiffness that an empty cell keeps.
    move : float in (0, 1], default 0.2
        Largest change of a variable in one iteration.
    tolerance : float, default 0.01
        Stop when no variable changes by more; 0 for never.
    objective_tolerance : float, default 1e-4
        Stop when the compliance changed less, relatively, over ten iterations; 0 for never.
    max_iterations : int, default 200
    backend : str, default "auto"
        Of the solves.

    Raises
    ------
    InputError
        For a parameter out of its range.
    """

    def __call__(
        self,
        problem: PlaneProblem | Problem,
        *,
        weights: Mapping[str, float] | None = None,
        solid: BoolArray | None = None,
        void: BoolArray | None = None,
        groups: IntArray | None = None,
        start: FloatArray | None = None,
        progress: Progress = silent,
    ) -> Design:
        """Optimise a plate or a part.

        Parameters
        ----------
        problem : PlaneProblem or Problem
            With the stiffness of full density; supports at rest.
        weights : mapping of load case name to float, optional
            Compliances are summed with these; default 1 each.
        solid, void : (m,) bool arrays, optional
            Passive cells, which stay full or empty.
        groups : (m,) int array, optional
            Cells with the same number share one density: the columns of a plate of tetrahedra.
        start : (m,) array in [0, 1], optional
            Variables to start from (`Design.variables` to continue a run); default uniform.
        progress : callable, optional
            Told the compliance, volume and change of each iteration.

        Raises
        ------
        InputError
            For data that do not fit the problem, and a volume that passive cells make impossible.
        SolveError
            When a solve misses its tolerance.
        """
        part = Compliance(problem, weights, self.backend, groups)
        space = Parametrisation.of_part(self, part, solid, void)
        return iterate(problem, part, space, start, progress)[0]
