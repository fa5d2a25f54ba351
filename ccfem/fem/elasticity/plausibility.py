"""Whether a part and its solution can be as they were meant: one look at both.

Impossible numbers are refused where they are given (`ccfem.base.checks.Range`). Here the part is
judged as a whole: sizes that are usual in another unit, loads that supports take at once, walls
with too few cells; and of the solution equilibrium, and the limits of linear theory and of the
material. What is improbable is said in a line, each with its cure; what cannot be right is refused:

* reactions that do not balance the loads, since equilibrium is a law;
* a load case without effect, since its zero would pass for an answer;
* a displacement of more than ten times the size of the part: either a unit is wrong or hardly
  anything holds it. Between a twentieth and ten times there is a remark only, since solutions are
  proportional to the load: paths and ratios of stiffness under a load of any size, as under a unit
  load on a slender part, are those under the load at which it works.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import BED, SPRING
from ccfem.base.errors import InputError, SolveError
from ccfem.base.tensor import von_mises
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.check import about_size, about_slivers, coarse_wall
from ccfem.fem.elasticity.error_estimate import ErrorEstimate
from ccfem.fem.elasticity.held import Held, rigid_modes
from ccfem.fem.elasticity.load_kinds import (
    Displacement,
    Load,
    SurfaceLoad,
    in_words,
    kind_of,
    patches_of,
    sizes_of,
)
from ccfem.fem.elasticity.loads import free_strain, nodal_forces
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.support_kinds import (
    AnySupport,
    Foundation,
    PointSpring,
    RigidPatch,
    Spring,
    TiedPatch,
)
from ccfem.fem.elasticity.zone import averaged_mises
from ccfem.fem.materials import Material
from ccfem.geometry.facets import are_among

_LINEAR = 0.05
"""Displacement over the size of the part, and strain, up to which linear theory holds: the tip of a
cantilever that moves by a twentieth of its length is off by less than 1 %."""
_FARTHEST = 10.0
"""Displacement over the size of the part above which a solution is refused: a part that works moves
by a hundredth or less, and units that are taken for each other differ by a thousand or more."""
_DEGREES = 5.0
"""Rotation of a support up to which linear theory holds: sqrt(1 + angle^2) is 1.004."""
_RIGID = 0.02
"""Deformation over displacement below which a part moves nearly as a rigid body."""
_BALANCE = 1e-4
"""Force and moment that reactions may leave, over the sum of the forces: as `contact` allows."""
_COARSER = 1.2
"""Width of facets over that of the facets they are tied to from which there is a remark."""
_ROUNDING = 1e-12
"""The same over the sizes that cancel in the equations: stiffness of a cell times displacement."""
_NONE = 1e-9
"""Part of the forces of a load case that moves something, below which none does."""
_ALL, _SOME = 1.0 - 1e-9, 0.02
"""Shares of a load on held nodes from which it has no effect, and from which there is a remark."""
_LONG = 1.5
"""Longest edge over thickness of a wall of one quadratic cell from which there is a remark, if the
error is not known: the deflection of a plate is right to 1 % at 3.3, stress round holes is not."""


def about_problem(
    problem: Problem,
    at_rest: Held | None = None,
    cases: Iterable[str] | None = None,
    error: float = np.nan,
) -> tuple[str, ...]:
    """Say what of a part may be in another unit, or not as it was meant.

    Parameters
    ----------
    problem : Problem
        With one set of supports.
    at_rest : Held, optional
        Its supports; without them the loads on held nodes are not looked for.
    cases : iterable of str, optional
        Load cases to be looked at; default all.
    error : float, optional
        Estimated error of the solution, if it is known: cells that leave little of it are fine
        enough.

    Returns
    -------
    tuple of str
        One line each, with its cure.
    """
    names = list(problem.loads if cases is None else cases)
    lines = [about_size(problem.mesh.points)]
    for material, _ in problem.materials:
        lines += _about_material(material)
    for support in problem.supports:
        lines += _about_support(support, problem)
    for name in names:
        for load in problem.loads[name]:
            lines += [f"load case '{name}': {line}" for line in _about_load(load, problem) if line]
            share = 0.0 if at_rest is None else held_share(problem, load, at_rest)
            lines.append(about_held_share(name, load, share))
    lines += _shared_facets(problem, names)
    lines += [_about_walls(problem, error), _about_chords(problem.mesh)]
    if problem.mesh.order == 1 and problem.order == 1 and linear_locks(problem):
        lines.append(
            "the material hardly changes its volume, and linear cells lock then: displacements are "
            "too small, whatever the estimated error: use quadratic cells (order = 2)"
        )
    return tuple(dict.fromkeys(line for line in lines if line))


def _about_material(material: Material) -> list[str]:
    """Say which numbers of a material are usual in another unit."""
    name = f"of material '{material.name}'"
    return [sizes.about(f"{what} {name}", value) for what, value, sizes in material.sizes]


def _about_support(support: AnySupport, problem: Problem) -> list[str]:
    """Say which springs are of an unusual stiffness, and which motions are too large."""
    where = " on ".join((kind_of(support), *patches_of(support)))
    if isinstance(support, Spring | PointSpring):
        return [SPRING.about(f"stiffness of {where}", value) for value in set(support.stiffness)]
    if isinstance(support, Foundation):
        return [BED.about(f"stiffness of {where}", value)
                for value in {support.normal, support.tangential}]  # fmt: skip
    if isinstance(support, TiedPatch):
        return [_about_tie(support, problem.mesh)]
    lines = [_about_motion(where, getattr(support, "value", 0.0), problem)]
    if isinstance(support, RigidPatch) and max(map(abs, support.angle)) > _DEGREES:
        lines.append(
            f"{where} turns by {max(map(abs, support.angle)):g} degrees, and rotations are linear "
            f"here: beyond {_DEGREES:g} degrees take the stress for a rough guess, or turn it less"
        )
    return lines


def _about_tie(support: TiedPatch, mesh: TetMesh) -> str:
    """Say that the coarser of two tied patches follows the finer one."""
    size, other = (float(mesh.facet_areas(mesh.patch(name))[0].mean()) for name in support.patches)
    if size <= _COARSER**2 * other:
        return ""
    return (
        f"'{support.patch}', whose facets are {np.sqrt(size / other):.2g} times as wide, is tied "
        f"to the finer '{support.to}', and nodes of that between those tied are left out, which "
        f"makes the joint too soft: tie '{support.to}' to '{support.patch}'"
    )


def _about_motion(where: str, motion: float | tuple[float, ...], problem: Problem) -> str:
    """Say that a support moves too far for linear theory."""
    far, size = float(np.linalg.norm(motion)), _size(problem)
    if far <= _LINEAR * size:
        return ""
    return (
        f"{where} moves by {far:.4g} mm, {far / size:.0%} of the size of the part: linear theory "
        f"holds to about {_LINEAR:.0%}: give the motion in mm, or a smaller one, since stress is "
        "proportional to it"
    )


def _farthest_support_move(problem: Problem, case: str) -> float:
    """Farthest that a load case moves a support, mm: `about_problem` remarks on it."""
    motions = [getattr(support, "value", 0.0) for support in problem.supports]
    motions += [load.vector for load in problem.loads_of(case) if isinstance(load, Displacement)]
    return max(float(np.linalg.norm(motion)) for motion in motions or [0.0])


def _about_load(load: Load, problem: Problem) -> list[str]:
    """Say which sizes of a load are usual in another unit."""
    if isinstance(load, Displacement):
        return [_about_motion(in_words(load), load.vector, problem)]
    return [sizes.about(what, value) for what, value, sizes in sizes_of(load)]


def _size(problem: Problem) -> float:
    """Diagonal of a part, mm."""
    return float(np.linalg.norm(np.ptp(problem.mesh.points[problem.mesh.corners], axis=(0, 1))))


def held_share(problem: Problem, load: Load, at_rest: Held) -> float:
    """Share of the nodal forces of a load on a patch that supports take at once.

    It is 0 for a load in the volume, whose share on held nodes is meant, and where nodes have axes
    of their own.
    """
    if at_rest.ties is not None or not isinstance(load, SurfaceLoad):
        return 0.0
    forces = nodal_forces(problem.mesh, load)
    sizes = np.linalg.norm(forces, axis=1)
    moving = np.linalg.norm(np.where(at_rest.free[: len(forces)], forces, 0.0), axis=1)
    return 1.0 - float(moving.sum() / sizes.sum())


def about_held_share(case: str, load: Load, share: float) -> str:
    """Say that supports take a share of a load at once; empty for next to nothing."""
    if share >= _ALL:
        return (
            f"load case '{case}': {in_words(load)} acts on held nodes alone and does nothing: "
            "choose another patch for the load, or for the support"
        )
    if share <= _SOME:
        return ""
    return (
        f"load case '{case}': {share:.0%} of {in_words(load)} acts on held nodes and has no "
        "effect: keep the patches of loads and supports apart"
    )


def _shared_facets(problem: Problem, cases: Iterable[str]) -> list[str]:
    """Say which patches are loaded and held at once."""
    supported = {name for support in problem.supports for name in patches_of(support)}
    loaded = {
        name
        for case in cases
        for load in problem.loads[case]
        if not isinstance(load, Displacement)
        for name in patches_of(load)
    }
    lines = []
    for load in sorted(loaded):
        for support in sorted(supported - {load}):
            both = are_among(problem.mesh.patch(load), problem.mesh.patch(support))
            if both.any():
                lines.append(
                    f"patches '{load}' (loaded) and '{support}' (held) share {int(both.sum())} of "
                    f"{len(both)} facets: choose patches that do not overlap"
                )
    return lines


def _about_walls(problem: Problem, error: float) -> str:
    """Say that walls have one cell across, where that spoils what is wanted of them."""
    if error <= LARGEST_ERROR:
        return ""
    linear = problem.mesh.order == 1 and problem.order == 1
    wall = coarse_wall(problem.mesh)
    if wall is None or not (linear or wall.edge > _LONG * wall.thickness):
        return ""
    at = ", ".join(f"{x:.4g}" for x in wall.place)
    spoilt = (
        "which are several times too stiff where the wall bends: use quadratic cells (order = 2), "
        f"or edges of at most {0.5 * wall.thickness:.3g} mm"
        if linear
        else "too long for the stress round holes and corners: use edges of at most "
        f"{wall.thickness:.3g} mm"
    )
    return (
        f"walls of {wall.thickness:.3g} mm, as at ({at}) mm, have one cell across, with edges of "
        f"{wall.edge:.3g} mm, {spoilt}"
    )


def _about_chords(mesh: TetMesh) -> str:
    """Say where quadratic cells do not follow a round wall."""
    count, gap = mesh.chords
    if not count:
        return ""
    return (
        f"{count} sides of quadratic cells on round walls stay straight, up to {gap:.3g} mm off "
        "the wall, since their cells would fold: use shorter edges there"
    )


def check_effect(problem: Problem, case: str, held: Held, forces: FloatArray, size: float) -> None:
    """Refuse a load case, or a combination, under which nothing moves.

    The forces (n, 3), N, are added up from forces whose sizes are `size` together. The error names
    the cause: cases of a combination that cancel, or loads on held nodes alone.
    """
    if held.value.any():
        return
    if case in problem.combinations and np.linalg.norm(forces, axis=1).sum() <= _NONE * size:
        factors = problem.factors(case).items()
        terms = " + ".join(f"{factor:g} {name}" for name, factor in factors)
        raise InputError(
            f"combination '{case}' is zero, for its load cases cancel ({terms}): change a factor, "
            "or leave it out"
        )
    lifts = held.presses is not None and (held.along_pressing(forces) < 0.0).any()
    if not lifts and np.linalg.norm(held.project(forces)) <= _NONE * size:
        names = sorted({name for load in problem.loads_of(case) for name in patches_of(load)})
        on = f" (on {', '.join(names)})" if names else ""
        raise InputError(
            f"load case '{case}'{on} acts on held nodes alone and does nothing: choose another "
            "patch for the load, or for the support"
        )


def check_balance(
    problem: Problem,
    case: str,
    displacement: FloatArray,
    forces: FloatArray,
    reactions: FloatArray,
    moved: bool,
) -> None:
    """Refuse a displacement (n, 3), mm, whose reactions do not balance its forces (n, 3), N.

    Where supports are moved, the reactions are loads, too.
    """
    mesh, both = problem.mesh, forces + reactions
    arm = mesh.points - mesh.points[mesh.corners].mean(axis=(0, 1))
    cell = float(np.abs(problem.cell_stiffness).max()) * float(np.cbrt(mesh.volumes.max()))
    sizes = float(np.linalg.norm(forces, axis=1).sum())
    if moved:
        sizes += float(np.linalg.norm(reactions, axis=1).sum())
    most = _BALANCE * sizes + _ROUNDING * cell * float(np.linalg.norm(displacement, axis=1).sum())
    force = float(np.linalg.norm(both.sum(axis=0)))
    moment = float(np.linalg.norm(np.cross(arm, both).sum(axis=0)))
    if not (force <= most and moment <= most * _size(problem)):
        raise SolveError(
            f"load case '{case}': the reactions leave {force:.3g} N and {moment:.3g} N mm of "
            f"forces of {sizes:.3g} N in all, so they do not balance the loads: hold the part "
            "better, or take a direct backend"
        )


def check_size_of_motion(problem: Problem, case: str, displacement: FloatArray) -> None:
    """Refuse a displacement (n, 3), mm, of more than ten times the part: see the top."""
    far, size = _largest_difference(displacement), _size(problem)
    if not far <= _FARTHEST * size:
        raise InputError(f"load case '{case}': {_about_far(problem, displacement, far, size)}")


def _largest_difference(displacement: FloatArray) -> float:
    """Difference of the displacements of a part, mm: moving as a whole is no matter."""
    return float(np.linalg.norm(np.ptp(displacement, axis=0)))


def _about_far(problem: Problem, displacement: FloatArray, far: float, size: float) -> str:
    """Say that a part moves too far for linear theory, and the likely reason."""
    points = problem.mesh.points
    modes = rigid_modes((points - points.mean(axis=0)) / size)
    moved = displacement.reshape(-1) / far if np.isfinite(far) else np.zeros(displacement.size)
    share = np.linalg.lstsq(modes.T @ modes, modes.T @ moved, rcond=None)[0]
    rest = float(np.linalg.norm(moved - modes @ share)) / max(float(np.linalg.norm(moved)), 1e-300)
    about = f"the part moves by {far:.4g} mm, {far / size:.3g} times its size of {size:.4g} mm, "
    if rest < _RIGID:
        return about + (
            "nearly as a rigid body, so hardly anything holds it: add a support, or a stiffer "
            "spring"
        )
    return about + (
        f"and linear theory holds to about {_LINEAR:g} times: check the units of loads and moduli "
        "(N, mm, MPa), or give a smaller load, since all results are proportional to it"
    )


def about_solution(
    problem: Problem,
    case: str,
    displacement: FloatArray,
    stress: FloatArray,
    nodal: FloatArray,
    error: ErrorEstimate | None,
) -> tuple[str, ...]:
    """Say what of a solution lies beyond linear theory, the strength, or the cells.

    Parameters
    ----------
    problem : Problem
        As it was solved.
    displacement : (n, 3) array, mm
    stress, nodal : (m, 3, 3) and (n, 3, 3) array, MPa
        Of the cells, and at the nodes.
    error : ErrorEstimate, optional
        Where it was estimated.

    Returns
    -------
    tuple of str
        One line each, with its cure.
    """
    judged, average, centroid = averaged_mises(problem, case, stress)
    lines = [] if error is None else [_about_error(problem, case, error, nodal, judged)]
    far, size = _largest_difference(displacement), _size(problem)
    if far > _LINEAR * size and not _farthest_support_move(problem, case) > _LINEAR * size:
        lines.append(_about_far(problem, displacement, far, size))
    lines.append(_about_strength(problem, average, judged, centroid))
    return tuple(line for line in lines if line)


def _about_strength(
    problem: Problem, average: FloatArray, judged: IntArray, centroid: FloatArray
) -> str:
    """Say that the averaged stress is above the strength, or the strain above linear theory."""
    if not len(judged):
        return ""
    strength, modulus = np.full(len(centroid), np.inf), np.full(len(centroid), np.inf)
    for material, cells in problem.materials:
        strength[cells] = material.tensile_strength or np.inf
        modulus[cells] = float(1.0 / np.linalg.inv(material.stiffness)[0, 0])
    used = average / strength[judged]
    worst = int(used.argmax())
    at = ", ".join(f"{x:.4g}" for x in centroid[judged[worst]])
    if used[worst] > 1.0:
        return (
            f"averaged over 2 mm, the von Mises stress at ({at}) mm is {average[worst]:.4g} MPa, "
            f"above the tensile strength of {strength[judged[worst]]:.4g} MPa: without fibre the "
            f"part fails there at {1.0 / used[worst]:.2g} times this load"
        )
    if problem.stiffness is not None or problem.density is not None:
        return ""
    strain = average / modulus[judged]
    worst = int(strain.argmax())
    if strain[worst] <= _LINEAR:
        return ""
    at = ", ".join(f"{x:.4g}" for x in centroid[judged[worst]])
    return (
        f"the part strains by {strain[worst]:.3g} at ({at}) mm, and linear theory holds to about "
        f"{_LINEAR:g}: check the units of loads and moduli (N, mm, MPa)"
    )


# Choice of linear or quadratic cells for a solve on a mesh of linear ones.
#
# Linear tetrahedra lock in bending, and where the material is nearly incompressible: one layer of
# them through a plate shows a tenth of its deflection. The error they leave is estimated with every
# solve. If it is too large, the part is solved again on quadratic cells.


LARGEST_ERROR = 0.1
"""Estimated error, in energy norm, up to which cells are fine enough: 1 % of the displacement, and
12 % of the stress where it peaks (measured at a hole in a plate)."""

LARGEST_PEAK_ERROR = 0.03
"""Estimated error of the largest stress from which there is a remark. On NAFEMS LE1 and LE11 and
holes in plates, of 2 to 24 %, it was that of this stress within a factor of about three, and all
that were off by more than 3 % were above."""

_LOCKS = 2.0 * 1.45 / (3.0 * (1.0 - 2.0 * 0.45))
"""Bulk over shear modulus above which linear cells lock: Poisson's ratio 0.45."""

MOST_CELLS = 300_000
"""Number of cells up to which quadratic ones are chosen automatically: about 4 GB, minutes
(measured)."""


def linear_locks(problem: Problem) -> bool:
    """Whether linear cells are known to be poor under any load: nu above 0.45."""
    if problem.stiffness is not None:
        count = len(problem.stiffness)
        sample = problem.stiffness[:: max(1, count // 1000)]
        return incompressibility(sample) > _LOCKS
    return any(incompressibility(m.stiffness) > _LOCKS for m, _ in problem.materials)


def why_quadratic(problem: Problem, error: float = 0.0) -> str:
    """Why "auto" takes quadratic cells, by the estimated error of linear ones if it is known.

    Empty where linear ones do.
    """
    if linear_locks(problem):
        return "the material hardly changes its volume, where linear ones lock"
    if error <= LARGEST_ERROR:
        return ""
    # The displacement does not follow the energy under heat.
    hot = any(free_strain(problem, case) is not None for case in problem.loads)
    also = "" if hot else f", about {error**2:.0%} of the displacement"
    return f"linear ones leave an estimated error of {error:.0%}{also}"


def _about_error(
    problem: Problem, case: str, error: ErrorEstimate, nodal: FloatArray, judged: IntArray
) -> str:
    """Say what to do about an estimated error, in all or where the stress peaks.

    The stress of the judged cells (k,) peaks at the node of the largest von Mises stress; its error
    is that of the cells round this node. Empty if both errors are small enough.
    """
    whole, peak, where = error.relative, 0.0, ""
    if len(judged):
        nodes = np.unique(problem.mesh.cells[judged])
        mises = von_mises(nodal[nodes])
        node = nodes[mises.argmax()]
        peak = error.relative_in((problem.mesh.cells == node).any(axis=1))
        at = ", ".join(f"{x:.4g}" for x in problem.mesh.points[node])
        where = f"{peak:.0%} in the stress where it peaks, {mises.max():.4g} MPa at ({at}) mm"
    if whole <= LARGEST_ERROR and peak <= LARGEST_PEAK_ERROR:
        return ""
    terms, cure = [], "smaller cells"
    if whole > LARGEST_ERROR:
        # Neither where cells lock nor under heat does the displacement follow the energy.
        known = not (problem.mesh.order == 1 and linear_locks(problem))
        known &= free_strain(problem, case) is None
        also = f", about {whole**2:.0%} of the displacement" if known else ""
        terms.append(f"{whole:.0%} in energy norm{also}")
    if peak > LARGEST_PEAK_ERROR:
        terms.append(where)
        cure += " there; a sharp inner edge needs its radius" if len(terms) == 1 else ""
    cure = f"quadratic cells (order = 2), or {cure}" if problem.mesh.order == 1 else cure
    return f"the cells leave an estimated error of {' and of '.join(terms)}: use {cure}"


def on_quadratic(problem: Problem) -> Problem:
    """Return the same problem on quadratic cells."""
    return replace(problem, mesh=problem.mesh.quadratic(), order=2)


# Causes of ill-conditioned equations of a part, and their cures.


_NEARLY_INCOMPRESSIBLE = 500.0
"""Bulk over shear modulus above which there is a remark: Poisson's ratio 0.499."""
_CONTRAST = 1e5
"""Largest over least stiffness of the cells above which there is a remark."""


def incompressibility(stiffness: FloatArray) -> float:
    """Bulk modulus over the least shear modulus, as the maximum over all cells.

    ``2 (1 + nu) / (3 (1 - 2 nu))`` of an isotropic material: 2.2 at nu 0.3, 9.7 at 0.45.
    """
    compliance = np.linalg.inv(stiffness.reshape(-1, 6, 6))
    bulk = 1.0 / compliance[:, :3, :3].sum(axis=(1, 2))
    shear = 1.0 / np.linalg.eigvalsh(compliance)[:, -1]  # of the softest change of shape
    return float((bulk / shear).max())


def stiffness_contrast(stiffness: FloatArray, density: FloatArray | None) -> float:
    """Largest over least stiffness of the cells."""
    size = np.trace(stiffness.reshape(-1, 6, 6), axis1=1, axis2=2)
    size = size if density is None else size * density
    return float(size.max() / size.min())


def about_conditioning(problem: Problem) -> str:
    """Say what makes the equations of a problem ill-conditioned, each with its cure."""
    warnings, stiffness = [about_slivers(problem.mesh)], problem.cell_stiffness
    bulk = incompressibility(stiffness)
    if bulk > _NEARLY_INCOMPRESSIBLE:
        warnings.append(
            f"the material is nearly incompressible, {bulk:.2g} times as stiff in volume as in "
            "shape: take a Poisson's ratio of 0.49 or less, or a direct backend"
        )
    contrast = stiffness_contrast(stiffness, problem.density)
    if contrast > _CONTRAST:
        warnings.append(
            f"the stiffest cell is {contrast:.2g} times as stiff as the softest: raise the least "
            "density or stiffness"
        )
    warnings = [text for text in warnings if text]
    return "; ".join(warnings) or (
        "no single cell is to blame: the part is slender, or held at very little; hold it wider, "
        "or take a direct backend"
    )
