"""The analysis of an Abaqus or CalculiX deck as the values that a part file makes.

Each static step (`ccfem.cases.deck_steps`) is a load case; sets that are held become patches where
their nodes make facets, and nodes elsewhere; sections (`ccfem.cases.deck_materials`) are regions.
What cannot be taken over is a mistake, with its line.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError, known_names, shown
from ccfem.body.files.deck import read_deck
from ccfem.body.files.formats.inp import mesh_of
from ccfem.body.mesh.check import check_coordinates
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.deck_constraints import DEGREES, Coupling, DeckConstraints, Tie, tied
from ccfem.cases.deck_materials import TAKE_OUT, CellMaterials, DeckMaterials, DeckReading
from ccfem.cases.deck_steps import BODY, DeckSteps, FaceLoad, State
from ccfem.fem.elasticity import load_kinds
from ccfem.fem.elasticity.problem import Region
from ccfem.fem.elasticity.support_kinds import (
    AnySupport,
    LocalSupport,
    NodeSupport,
    RigidPatch,
    Support,
    TiedPatch,
)
from ccfem.fem.materials import Material
from ccfem.geometry.facets import are_among, facet_keys

_MOVED = 1e-3
"""Distance over the size of the part by which nodes of folded cells may have been moved."""
_SAME = 1e-9
"""Difference of loads, over their size, that counts as rounding."""


@dataclass(frozen=True)
class DeckAnalysis:
    """A deck as values of a part."""

    mesh: TetMesh  # in mm, as it stands in the deck, with patches of its sets, supports and loads
    materials: CellMaterials
    # As in `ccfem.fem.elasticity.problem.Problem`; a load case a static step.
    supports: tuple[AnySupport, ...]
    case_supports: Mapping[str, tuple[AnySupport, ...]]
    loads: Mapping[str, tuple[load_kinds.Load, ...]]
    remarks: tuple[str, ...]  # what was left out, with its line

    def on_cells(self, mesh: TetMesh) -> tuple[Material, tuple[Region, ...], FloatArray | None]:
        """Material, regions and axes of the cells of its mesh, mended or made quadratic."""
        _, at = cKDTree(self.mesh.centres).query(mesh.centres)
        kinds = [*self.supports, *chain(*self.case_supports.values()), *chain(*self.loads.values())]
        places = [point for kind in kinds for point in load_kinds.points_of(kind)]
        size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
        away = cKDTree(mesh.points).query(places)[0] if places else np.zeros(0)
        if (away > _MOVED * size).any():
            raise InputError(
                f"{np.count_nonzero(away > _MOVED * size)} nodes that the deck holds or loads "
                "belong to no cell once flat ones are taken out: mesh the part again"
            )
        first, *others = self.materials.materials
        number, axes = self.materials.number[at], self.materials.axes
        chosen = [np.flatnonzero(number == k) for k in range(1, len(others) + 1)]
        regions = (Region(x, cells) for x, cells in zip(others, chosen, strict=True) if len(cells))
        return first, tuple(regions), None if axes is None else axes[at]


def read_analysis(path: Path, scale: float = 1.0, step: str | None = None) -> DeckAnalysis:
    """Read a deck with its analysis.

    Parameters
    ----------
    path : Path
        An ``.inp`` file.
    scale : float, default 1
        Unit of length of the deck, mm; forces are in N and times in s.
    step : str, optional
        The step that is taken, by its name or as ``step_2``; default all static ones.

    Raises
    ------
    InputError
        With a line for everything that cannot be taken over.
    """
    model, deck = read_deck(path)
    used = np.zeros(len(model.points), dtype=bool)
    used[model.nodes[model.nodes >= 0]] = True
    check_coordinates(model.points, used)
    joined = tied(model, deck, path)
    model, cells = joined.model, joined.cells
    reading = DeckReading(model, deck, scale, cells)
    reading.mistakes.lines += joined.mistakes
    reading.remarks += joined.remarks
    mesh = mesh_of(model, cells, path)
    constraints = DeckConstraints(reading, mesh)
    for block, scope in deck.rest:
        constraints.take(block, scope)
    constraints.end()
    steps, known = DeckSteps(reading, mesh, constraints), DeckMaterials(reading)
    for block, scope in deck.rest:
        if block.keyword in DeckMaterials.KEYWORDS:
            known.take(block, scope)
        elif block.keyword not in DeckConstraints.KEYWORDS:
            with reading.noted(block):
                steps.take(block)
    steps.end_step()
    materials = known.of_cells(steps.mesh.centres)
    for kind, count in deck.bare.items():
        what = f"elements {kind or 'without type'}, which have no volume"
        reading.remarks.append(f"{path}: {count} lines of {what}, are left out")
    conversion = _Conversion(steps, known.expand, joined.ties)
    cases = conversion.chosen(step, path)
    reading.mistakes.complain()
    assert materials is not None
    if any(
        isinstance(load, load_kinds.Temperature) for _, loads in cases.values() for load in loads
    ):
        materials = materials.with_expansion()
    first = next(iter(cases.values()))[0]
    shared = tuple(s for s in first if all(s in supports for supports, _ in cases.values()))
    special = {
        name: tuple(s for s in supports if s not in shared) for name, (supports, _) in cases.items()
    }
    mesh = conversion.mesh
    return DeckAnalysis(
        TetMesh(mesh.points * scale, mesh.cells, mesh.patches),
        materials,
        shared,
        {name: supports for name, supports in special.items() if supports},
        {name: loads for name, (_, loads) in cases.items()},
        tuple(reading.remarks),
    )


class _Conversion:
    """What acts in the steps of a deck as supports and loads of a part.

    Attributes
    ----------
    expand : bool
        Whether some material grows by heat.
    """

    def __init__(self, steps: DeckSteps, expand: bool, ties: Sequence[Tie]) -> None:
        self.ties = ties
        self.steps, self.reading, self.mesh, self.expand = steps, steps.reading, steps.mesh, expand
        self.constraints = steps.constraints
        self._border_nodes = steps.mesh.facet_nodes(steps.border)
        self._patches = dict(steps.mesh.patches)

    def chosen(
        self, wanted: str | None, path: Path
    ) -> dict[str, tuple[tuple[AnySupport, ...], tuple[load_kinds.Load, ...]]]:
        """Supports and loads of the static steps that do something, or of the one that is named."""
        steps = [step for step in self.steps.ended if step.static]
        names = [step.name for step in self.steps.ended]
        if wanted is not None:
            known = [x for x in steps if wanted.upper() in (x.name.upper(), f"STEP_{x.number}")]
            if not known:
                self.reading.mistakes.complain()
                raise InputError(
                    f"{path} has no static step {shown(wanted)}; its steps are "
                    f"{known_names(wanted, names) or 'none'}"
                )
            steps = known[:1]
        cases: dict[str, tuple[tuple[AnySupport, ...], tuple[load_kinds.Load, ...]]] = {}
        for step in steps:
            with self.reading.noted(step.block):
                supports, moves = self._supports(step.state)
                loads = self._loads(step.state)
                if not loads and not moves:
                    self.reading.remark(step.block, f"'{step.name}' has no load and is left out")
                    continue
                name = step.name if step.name not in cases else f"{step.name} ({step.number})"
                cases[name] = supports, loads
        if not cases:
            self.reading.mistakes.complain()
            raise InputError(
                f"{path} has no static step with a load; its steps are {', '.join(names) or 'none'}"
                ": write one, or give supports and loads in the part file"
            )
        self.mesh = self.mesh.with_patches(self._patches)
        return cases

    def _supports(self, state: State) -> tuple[tuple[AnySupport, ...], bool]:
        """Supports that act, and whether one of them moves.

        The nodes of each set are held as patches where they make facets, the others as nodes.
        """
        value = np.zeros((len(self.mesh.points), 3))
        at_reference: dict[int, dict[str, float]] = {}
        holds = []
        for hold in state.holds:
            node = int(hold.nodes[0])
            if node in self.constraints.reference:
                number, _ = self.constraints.reference[node]
                for letter in hold.components:
                    at_reference.setdefault(number, {})[letter] = hold.value
                continue
            holds.append(hold)
            for c in map("xyz".index, hold.components):
                value[hold.nodes, c] = hold.value
        groups: dict[tuple[str, int, float], list[IntArray]] = {}
        for hold in holds:
            for c in map("xyz".index, hold.components):
                key = (hold.title, c, hold.value)
                groups.setdefault(key, []).append(hold.nodes[value[hold.nodes, c] == hold.value])
        # Components that hold the same nodes of a set make one support.
        joined: dict[tuple[str, bytes, int], dict[int, float]] = {}
        for (title, c, at), parts in groups.items():
            together = np.unique(np.concatenate(parts))
            system_of = self.constraints.system_of[together]
            for system in np.unique(system_of).tolist():
                chosen = together[system_of == system]
                joined.setdefault((title, chosen.tobytes(), system), {})[c] = at
        supports: list[AnySupport] = []
        for (title, chosen_bytes, system), values in joined.items():
            chosen = np.frombuffer(chosen_bytes, dtype=np.int64)
            supports += self._held_nodes(title, chosen, system, values)
        for tie in self.ties:
            slave, master = map(self._patch, tie.titles, (tie.slave, tie.master))
            within = None if tie.within is None else self.reading.scale * tie.within
            supports.append(TiedPatch(slave, master, within))
        for number, coupling in enumerate(self.constraints.couplings):
            supports += self._coupled(coupling, at_reference.get(number, {}))
        moves = any(any(held.values()) for held in at_reference.values())
        return tuple(dict.fromkeys(supports)), moves or bool(value.any())

    def _held_nodes(
        self, title: str, chosen: IntArray, system: int, values: Mapping[int, float]
    ) -> Iterator[AnySupport]:
        """Supports of nodes (k,) along the axes of a system: values by component."""
        inside = np.zeros(len(self.mesh.points), dtype=bool)
        inside[chosen] = True
        ends = self.reading.split.ends
        inside[len(inside) - len(ends) :] = inside[ends].all(axis=1)
        letters = "".join("xyz"[c] for c in sorted(values))
        x, y, z = (values.get(c, 0.0) for c in range(3))
        facets = self.steps.border[inside[self._border_nodes].all(axis=1)]
        local = self.constraints.systems[system] if system >= 0 else None
        if local is not None and letters == "xyz" and not any(values.values()):
            local = None  # held along all axes
        if len(facets):
            patch = self._patch(title, facets)
            if local is None:
                yield Support(patch, letters, (x, y, z))
            else:
                (a, b, c), (d, e, f) = (self.reading.scale * local.points).tolist()
                points = ((a, b, c), (d, e, f))
                yield LocalSupport(patch, points, local.system, letters, (x, y, z))
            inside[self.mesh.facet_nodes(facets)] = False
        inside[len(inside) - len(ends) :] = False
        if inside.any():
            places = self._places(inside)
            axes = () if local is None else local.at(self.mesh.points[inside]).swapaxes(1, 2)
            frames = tuple(((*a,), (*b,), (*c,)) for a, b, c in np.asarray(axes).tolist())
            yield NodeSupport(title, places, letters, (x, y, z), frames)

    def _coupled(self, coupling: Coupling, held: Mapping[str, float]) -> Iterator[AnySupport]:
        """Support of the faces of a coupling whose reference node is held at values by degree."""
        if not coupling.rigid:
            if held:
                raise InputError(
                    f"*DISTRIBUTING on '{coupling.title}' passes loads on, and its reference node "
                    f"is held: couple it by *KINEMATIC, or {TAKE_OUT}"
                )
            return
        patch = self._patch(coupling.title, coupling.facets)
        alone = coupling.held(held)
        if alone is not None:
            x, y, z = (alone.get(letter, 0.0) for letter in "xyz")
            yield Support(patch, coupling.components, (x, y, z))
            return
        if set(held) == set(DEGREES) and not any(held.values()):
            yield Support(patch)
            return
        held_at = [held.get(letter, 0.0) for letter in DEGREES]
        x, y, z = held_at[:3]
        u, v, w = np.degrees(held_at[3:]).tolist()
        moved, turned = ("".join(c for c in part if c in held) for part in ("xyz", "uvw"))
        about = turned.translate(str.maketrans("uvw", "xyz"))
        px, py, pz = (self.reading.scale * coupling.place).tolist()
        yield RigidPatch(patch, moved, about, (x, y, z), (u, v, w), (px, py, pz))

    def _places(self, chosen: BoolArray | IntArray) -> tuple[load_kinds.Vector, ...]:
        """Places of nodes, mm."""
        return tuple(
            (x, y, z) for x, y, z in (self.mesh.points[chosen] * self.reading.scale).tolist()
        )

    def _patch(self, title: str, facets: IntArray) -> str:
        """Name of the patch of some facets: one of the deck's own sets, or a new one."""
        for name in (title, *self._patches):
            known = self._patches.get(name, facets[:0])
            if len(known) == len(facets) and are_among(known, facets).all():
                return name
        name, count = title, 1
        while len(self._patches.get(name, ())):
            count += 1
            name = f"{title} ({count})"
        self._patches[name] = facets
        return name

    def _loads(self, state: State) -> tuple[load_kinds.Load, ...]:
        """Find the loads that act."""
        return (
            *self._forces(state),
            *self._on_faces(state),
            *self._in_volume(state),
            *self._heat(state),
        )

    def _forces(self, state: State) -> Iterator[load_kinds.Load]:
        """Sum up the forces at nodes: those of a step replace those of the steps before."""
        force = np.zeros((len(self.mesh.points), 6 if self.constraints.couplings else 3))
        since = np.zeros(force.shape, dtype=np.int64)
        for load in state.nodes:
            c, nodes = load.component, load.nodes
            force[nodes, c] = np.where(since[nodes, c] < load.step, 0.0, force[nodes, c])
            force[nodes, c] += load.value
            since[nodes, c] = load.step
        for node, (number, _) in self.constraints.reference.items():
            yield from self._spread(self.constraints.couplings[number], force[node])
            force[node] = 0.0
        loaded = np.flatnonzero(force.any(axis=1))
        if len(loaded):
            vectors = force[loaded, :3]
            for k, system in enumerate(self.constraints.systems):
                turned = np.flatnonzero(self.constraints.system_of[loaded] == k)
                axes = system.at(self.mesh.points[loaded[turned]])
                vectors[turned] = np.einsum("kij,kj->ki", axes, vectors[turned])
            yield load_kinds.NodeForces(
                self._places(loaded), tuple((x, y, z) for x, y, z in vectors.tolist())
            )

    def _spread(self, coupling: Coupling, total: FloatArray) -> Iterator[load_kinds.Load]:
        """Force and moment (6,) of a reference node as they act on the faces that hang on it."""
        if not total.any():
            return
        if coupling.components != "xyz":
            raise InputError(
                f"a force acts on the reference node that '{coupling.title}' follows in "
                f"{coupling.components} alone: {TAKE_OUT}"
            )
        patch, scale = self._patch(coupling.title, coupling.facets), self.reading.scale
        area, _ = self.mesh.facet_areas(coupling.facets)
        centroid = area @ self.mesh.points[coupling.facets].mean(axis=1) / area.sum()
        arm = coupling.place - centroid
        force, moment = total[:3], total[3:] + np.cross(arm, total[:3])
        if force.any():
            fx, fy, fz = force.tolist()
            yield load_kinds.Force(patch, (fx, fy, fz))
        if np.linalg.norm(moment) > _SAME * np.linalg.norm(force) * np.linalg.norm(arm):
            mx, my, mz = (scale * moment).tolist()
            yield load_kinds.Moment(patch, (mx, my, mz))

    def _on_faces(self, state: State) -> Iterator[load_kinds.Load]:
        """Pressures and tractions, one of each size on a patch; those on one set add up."""
        sums: dict[tuple[str, bytes, load_kinds.Vector | None], tuple[FaceLoad, float]] = {}
        for load in state.faces:
            (keys,) = facet_keys(load.facets)
            key = (load.title, np.sort(keys, kind="stable").tobytes(), load.vector)
            sums[key] = load, sums.get(key, (load, 0.0))[1] + load.size
        for load, size in sums.values():
            if not size:
                continue
            patch = self._patch(load.title, load.facets)
            if load.vector is None:
                yield load_kinds.Pressure(patch, size)
            else:
                x, y, z = (size * part for part in load.vector)
                yield load_kinds.Traction(patch, (x, y, z))

    def _in_volume(self, state: State) -> Iterator[load_kinds.Load]:
        """Weight, forces of the volume and centrifugal loads, which the whole part must bear."""
        scale = self.reading.scale
        pull = np.zeros((len(self.mesh.cells), 3))
        force = np.zeros(pull.shape)
        turning: dict[tuple[float, ...], FloatArray] = {}
        for load in state.bodies:
            size, *rest = load.numbers
            if load.label == "GRAV":
                length = float(np.linalg.norm(rest))
                if size and not length:
                    raise InputError(f"GRAV of line {load.line} has no direction: give it one")
                pull[load.cells] += size * np.asarray(rest) / (length or 1.0)
            elif load.label == "CENTRIF":
                turning.setdefault(tuple(rest), np.zeros(len(pull)))[load.cells] += size
            else:
                force[load.cells, BODY[load.label]] += size
        sums = [("GRAV", pull), ("BX, BY and BZ", force)]
        sums += [("CENTRIF", squares[:, None]) for squares in turning.values()]
        for what, whole in sums:
            if np.ptp(whole, axis=0).max() > _SAME * np.abs(whole).max():
                raise InputError(
                    f"{what} acts on a part of the cells, and loads of the volume are followed "
                    f"where they are the same on all: {TAKE_OUT}"
                )
        if pull.any():
            x, y, z = (pull[0] * scale * 1e-3).tolist()
            yield load_kinds.Gravity((x, y, z))
        if force.any():
            x, y, z = (force[0] * scale**-3).tolist()
            yield load_kinds.BodyForce((x, y, z))
        for (px, py, pz, *axis), squares in turning.items():
            if not squares[0] >= 0.0:
                raise InputError("CENTRIF takes the square of a speed, above 0: correct it")
            if squares[0]:
                u, v, w = axis
                point = (px * scale, py * scale, pz * scale)
                yield load_kinds.Centrifugal(float(np.sqrt(squares[0])), point, (u, v, w))

    def _heat(self, state: State) -> Iterator[load_kinds.Load]:
        """Change of temperature, uniform or at the nodes."""
        if state.warmth is None:
            return
        start = (
            np.zeros(len(self.mesh.points)) if self.steps.initial is None else self.steps.initial
        )
        if np.isnan(start[self.steps.in_cell]).any():
            raise InputError("*INITIAL CONDITIONS gives no temperature to some nodes: give one")
        if self.steps.initial is None:
            self.reading.remarks.append(
                "*TEMPERATURE counts from 0: there is no *INITIAL CONDITIONS, TYPE=TEMPERATURE"
            )
        change = np.where(np.isnan(state.warmth), start, state.warmth) - start
        if self.steps.initial is None and np.isnan(state.warmth[self.steps.in_cell]).any():
            raise InputError("*TEMPERATURE leaves nodes out, and no *INITIAL CONDITIONS: give both")
        change = change[self.steps.in_cell]
        if not change.any():
            return
        if not self.expand:
            self.reading.remarks.append("*TEMPERATURE is left out: no material has *EXPANSION")
        elif np.ptp(change) == 0.0:
            yield load_kinds.Temperature(float(change[0]))
        else:
            yield load_kinds.Temperature(tuple(change.tolist()), self._places(self.steps.in_cell))
