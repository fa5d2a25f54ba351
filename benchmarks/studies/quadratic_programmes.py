"""Quadratic programmes of ccfem: its own iterations beside OSQP and Clarabel.

    python -m benchmarks.studies.quadratic_programmes [PROGRAMME ...]

The calls of a programme are recorded while parts are planned or solved, then made again by each
solver. Time is processor time of all calls together, the better of two runs; lines are those of
the functions that solve, without signatures and docstrings; unknowns are those of the first
call. The columns "cost" and "worst" are

    field    misfit of the gradients to the wanted ones; most excess of the bound 1 on their size
    heights  misfit to the wanted gradients; share of the volume outside the bounds on their size
    strands  roughness of the slides; most that is missing to the distance of strands, mm
    contact  energy less work of the loads, N mm; deepest sinking over the largest displacement

OSQP bounds the size of a gradient by polygons and polyhedra and, since a least size is no convex
bound, along the nearest gradient that is long enough. Strands, heights, and load cases are
sequences: they keep their model, and start from the last multipliers.
"""

import ast
import inspect
import sys
import textwrap
import warnings
from functools import partial
from time import process_time
from typing import Any

import numpy as np
import osqp
import scipy.sparse as sp

from benchmarks.studies.table import print_table
from ccfem.body.mesh import box_mesh
from ccfem.cases import create_case
from ccfem.fem.elasticity import (
    Force,
    PressingSupport,
    Pressure,
    Problem,
    Spring,
    Support,
    prepare,
)
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.statics import EXPECTED, find_contact, solve
from ccfem.fem.materials import isotropic
from ccfem.paths.fields import scalar
from ccfem.paths.planning import plan
from ccfem.slicing.guidance import bounded_gradient, height_field
from ccfem.slicing.slicers.load_oriented import LoadOriented
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import isocurve
from ccfem.strategies.fibre_aware import strand_spacing
from ccfem.strategies.stream_function import StreamFunction

SIDES = 16
"""Sides of the polygon inside the disc of gradients; its area is 2.6 % less."""
REACH = 0.25
"""Distance, in widths, beyond the least one within which OSQP watches strands and the border."""
FAR = 10.0
"""Distance, mm, within which those that are watched are measured again."""


def recorded(owner, name, work):
    """Arguments of the calls of a function while some work is done."""
    real, calls = getattr(owner, name), []

    def watched(*arguments, **options):
        calls.append(arguments)
        return real(*arguments, **options)

    setattr(owner, name, watched)
    try:
        work()
    finally:
        setattr(owner, name, real)
    return calls


def stressed(name):
    case = create_case(name)
    return case, next(iter(solve(case.problem).values()))


def planned(name, strategy, count):
    case, stress = stressed(name)
    layers = Planar(count=count).cut(stress.mesh, case.build)
    plan(strategy, layers, stress, case.machine)


def compressed(matrix):
    """Matrix as OSQP takes it."""
    matrix = sp.csc_matrix(matrix)
    matrix.indices, matrix.indptr = matrix.indices.astype("i4"), matrix.indptr.astype("i4")
    return matrix


def model(form, pull, rows, low, high, accuracy):
    """Model of ``min x form x / 2 - pull x`` with rows within bounds."""
    made, options = osqp.OSQP(), {"max_iter": 20_000, "check_termination": 10, "verbose": False}
    bounded = compressed(sp.triu(form)), -pull, compressed(rows), low, high
    made.setup(*bounded, eps_abs=accuracy, eps_rel=accuracy, **options)
    return made


def field_by_osqp(surface, direction, density, weight, width, spacing):
    target = np.minimum(density * width, 1.0)
    metric, flux = scalar._weighted_form(surface, direction, target, weight, spacing)
    scale = 1.0 / (surface.areas * weight).mean()
    x, y = surface.gradient_matrix[0::2], surface.gradient_matrix[1::2]
    angles = np.pi * np.arange(SIDES // 2) / (SIDES // 2)
    rows = sp.vstack([np.cos(a) * x + np.sin(a) * y for a in angles])
    most = np.full(rows.shape[0], np.cos(np.pi / SIDES))
    form, pull = scale * surface.energy(metric), scale * surface.source(flux)
    return model(form, pull, rows, -most, most, 1e-3).solve().x / width


def field(name, count):
    def rated(call, values):
        surface, direction, density, weight, width, spacing = call
        gradient = width * surface.gradient(values)
        astray = np.einsum("td,td->t", gradient, direction)
        across = gradient[:, 1] * direction[:, 0] - gradient[:, 0] * direction[:, 1]
        square = astray**2 + spacing * (across - np.minimum(density * width, 1.0)) ** 2
        return (surface.areas * weight) @ square, np.linalg.norm(gradient, axis=1).max() - 1.0

    work = partial(planned, name, isocurve.Isocurve(), count)
    calls = recorded(isocurve, "fit_constrained", work)
    fits = {"own": scalar.fit_constrained, "OSQP": field_by_osqp, "Clarabel": scalar.fit_cone}
    solvers = {by: (lambda f=fit: [f(*call) for call in calls], fit) for by, fit in fits.items()}
    return calls, len(calls[0][0].points), solvers, rated


def heights_by_osqp(mesh, slope, calls):
    count, made, answers = len(mesh.volumes), None, []
    weight = np.repeat(mesh.volumes / mesh.volumes.mean(), 3)
    at = np.repeat(np.arange(count), 3), np.arange(3 * count)
    corners = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T
    faces = [way / np.linalg.norm(way) for way in corners if tuple(way) > (0.0, 0.0, 0.0)]
    for target, bounds, plain in calls:
        near = bounds.nearest(plain(target).gradient)
        near /= np.linalg.norm(near, axis=1)[:, None]
        ways = [near, *(np.tile(way, (count, 1)) for way in (bounds.up, *faces))]
        rows = sp.vstack([sp.csr_array((way.ravel(), at)) @ slope for way in ways])
        most, free = np.full(len(faces) * count, bounds.most), np.full(2 * count, np.inf)
        pull = slope.T @ (weight * target.ravel())
        if made is None:
            low = np.append(np.repeat([bounds.least, 0.0], count), -most)
            form = slope.T @ sp.diags_array(weight) @ slope
            made = model(form, pull, rows, low, np.append(free, most), 1e-3)
        else:
            made.update(q=-pull, Ax=compressed(rows).data)
        answers.append((slope @ made.solve().x).reshape(-1, 3))
    return answers


def heights(name):
    def rated(call, gradient):
        (target, bounds), share = call[:2], mesh.volumes / mesh.volumes.sum()
        return share @ ((gradient - target) ** 2).sum(axis=1), share @ bounds.outside(gradient)

    case, stress = stressed(name)
    calls = recorded(height_field, "bounded", lambda: LoadOriented().slice(stress, case.build))
    mesh, count, own = stress.mesh, len(stress.mesh.corners), bounded_gradient.bounded
    places = np.repeat(np.arange(3 * count).reshape(count, 1, 3), 4, axis=1).ravel()
    entries = (cell_gradients(mesh).ravel(), (places, np.repeat(mesh.corners.ravel(), 3)))
    slope = sp.csr_array(entries, shape=(3 * count, len(mesh.points)))
    solvers = {
        "own": (lambda: [own(*c).gradient for c in calls], own, bounded_gradient.Bounds.nearest),
        "OSQP": (lambda: heights_by_osqp(mesh, slope, calls), heights_by_osqp),
    }
    return calls, len(np.unique(mesh.corners)), solvers, rated


def slides_by_osqp(self, slide, rounds=4):
    lines, width, made, inset = self.lines, self.width, None, self.inset + FAR
    points, normals, free = lines.points(slide), lines.normals, ~lines.fixed
    _, near = self.tree.query(strand_spacing._lifted(points, lines.layer), k=3)
    reach = self._pairs(points), (1.0 + REACH) * width
    column, _, room = strand_spacing._too_near(points, normals, *reach)
    # Of each strand beside a point, the segment that is nearest.
    order = np.lexsort((-room, lines.path[column[:, 1]], column[:, 0]))
    beside = np.column_stack([column[order, 0], lines.path[column[order, 1]]])
    first = np.append(True, (np.diff(beside, axis=0) != 0).any(axis=1))
    pairs = np.ascontiguousarray(column[order[first[: len(order)]], :2])
    for _ in range(rounds):
        points = lines.start + slide[:, None] * normals
        column, value, missing = strand_spacing._too_near(points, normals, pairs, FAR)
        border = near, self.border, self.inward, inset, normals
        off, deep = strand_spacing._outside(points, *border)
        if made is None:
            edge = np.flatnonzero((off != 0.0) & (deep > FAR - REACH * width) & free)
        count = len(pairs) + len(edge)
        rows = np.append(np.repeat(np.arange(len(pairs)), 3), np.arange(len(pairs), count))
        entries = np.append(value.ravel(), off[edge]) + 1e-300  # the same ones in each round
        matrix = sp.csr_matrix(
            (entries, (rows, np.append(column.ravel(), edge))), (count, len(points))
        )
        short = sp.eye_array(count)
        matrix = compressed(sp.hstack([matrix[:, free], short]))
        low, none = np.append(missing - FAR + width, deep[edge] - FAR), np.zeros(matrix.shape[1])
        if made is None:
            form = sp.block_diag([self.roughness[free][:, free], strand_spacing._STIFF * short])
            made = model(form, none, matrix, low, np.full(count, np.inf), 1e-3)
        else:
            made.update(Ax=matrix.data, l=low)
            made.warm_start(x=none)
        slide = slide.copy()
        slide[free] += made.solve().x[: free.sum()]
    return slide


def strands(name, count):
    def rated(call, slide):
        self, before = call
        move, points = np.where(self.lines.fixed, 0.0, slide - before), self.lines.points(slide)
        near = points, self.lines.normals, self._pairs(points), self.width
        return move @ (self.roughness @ move), strand_spacing._too_near(*near)[2].max(initial=0.0)

    spread = strand_spacing.Spacing.spread
    work = partial(planned, name, StreamFunction(evaluations=40), count)
    calls = recorded(strand_spacing.Spacing, "spread", work)
    solvers = {
        "own": (lambda: [spread(*call) for call in calls], spread, strand_spacing._solve),
        "OSQP": (lambda: [slides_by_osqp(*call) for call in calls], slides_by_osqp),
    }
    return calls, len(calls[0][1]), solvers, rated


def contact_by_osqp(matrix, held, cases):
    node, component, _ = held._pressing
    lifted, place = held.with_contact(np.zeros(len(node), dtype=bool)), np.full(len(held.free), -1)
    place[lifted.nodes] = np.arange(len(lifted.nodes))
    stiffness, most, made, answers = lifted.reduce(matrix), np.zeros(len(node)), None, []
    rows = sp.eye_array(stiffness.shape[0], format="csr")[3 * place[node] + component]
    for forces in cases:
        pull = lifted.right_hand_side(matrix, forces)
        if made is None:
            made = model(stiffness, pull, rows, np.full(len(node), -np.inf), most, 1e-5)
        else:
            made.update(q=-pull)
        answers.append(lifted.expand(made.solve().x))
    return answers


def pressed(*divisions):
    def own():
        solver, answers = system.factorise(matrix, "auto", EXPECTED * len(cases)), []
        for forces in cases:
            reached = find_contact(matrix, held, forces, solver, 1e-8)
            solver = reached.solver
            answers.append(reached.held.expand(reached.solution.values))
        return answers

    def rated(forces, moved):
        depth = held.along_pressing(moved).max() / np.abs(moved).max()
        return np.vdot(moved, 0.5 * (matrix @ moved.ravel()).reshape(-1, 3) - forces), depth

    table = (PressingSupport("z_min"), Support("x_min", "x"), Support("y_min", "y"))
    supports = (*table, Spring("x_max", (0.0, 0.0, 1.0)))
    pull = {lift: Force("x_max", (0.3, 0.1, lift)) for lift in (0.8, 0.6)}
    loads = {f"{lift:g}": (Pressure("z_max", 0.02), force) for lift, force in pull.items()}
    mesh = box_mesh((16.0, 4.0, 3.0), divisions)
    system = prepare(Problem(mesh, isotropic(100.0, 0.3), supports, loads, order=1))
    matrix, held, cases = system.assemble(), system.held, list(system.forces.values())
    solvers = {
        "own": (own, find_contact, Held.following),
        "OSQP": (lambda: contact_by_osqp(matrix, held, cases), contact_by_osqp),
    }
    return cases, held.unknowns, solvers, rated


PROGRAMMES: dict[str, Any] = {
    "field": (field, ("loop", 6), ("l_shape", 2), ("suspension", 2)),
    "heights": (heights, ("arm_bracket",), ("corner_bracket",), ("t_bracket",)),
    "strands": (strands, ("open_hole", 2), ("loop", 6)),
    "contact": (pressed, (16, 6, 4), (24, 8, 6), (32, 12, 8)),
}


def lines_of(*functions):
    """Lines of the bodies of functions, without docstrings, comments and empty lines."""
    total = 0
    for function in functions:
        source = textwrap.dedent(inspect.getsource(function))
        body: Any = ast.parse(source).body[0]
        parts = body.body[1:] if ast.get_docstring(body) else body.body
        nodes = [node for part in parts for node in ast.walk(part)]
        total += len({node.lineno for node in nodes if hasattr(node, "lineno")})
    return total


def rows(programme, _):
    """Rows of the table for one programme."""
    posed, *sizes = PROGRAMMES[programme]
    table = []
    for size in sizes:
        calls, unknowns, solvers, rated = posed(*size)
        for by, (work, *functions) in solvers.items():
            seconds = []
            for _ in range(2):
                start = process_time()
                answers = work()
                seconds.append(process_time() - start)
            cost, worst = zip(*map(rated, calls, answers), strict=True)
            table.append(
                f"| {programme} | {len(calls)} x {unknowns} | {by} | {sum(cost):.6g} | "
                f"{max(worst):.1e} | {1e3 * min(seconds):.0f} | {lines_of(*functions)} |"
            )
    return table


if __name__ == "__main__":
    warnings.filterwarnings("ignore", category=PendingDeprecationWarning)
    heads = "programme | calls x unknowns | by | cost | worst | time, ms | lines"
    print_table(sys.argv[1:], heads, PROGRAMMES, rows)
