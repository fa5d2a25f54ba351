"""A case: a problem with everything that a comparison of strategies needs."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from ccfem.base.arrays import freeze
from ccfem.base.checks import check_known, check_number, member_name
from ccfem.base.display import Shown
from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.plain import plain
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.judging.virtual_testing.scatter import DEFAULT_SCATTER, Scatter
from ccfem.machine.machine import Machine
from ccfem.paths.placement.fibre_places import FibrePlaces
from ccfem.paths.plastic.as_printed import as_printed
from ccfem.paths.plastic.plastic import SOLID, Plastic
from ccfem.printing.bed_layout import AS_IT_STANDS, BedLayout, bed_of, spun
from ccfem.printing.line_counts import MOST_STRANDS, about_strands, check_strands
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers.planar import Planar


@dataclass(frozen=True)
class Case(Shown):
    """A part with its loads, its slicing, and the machine that prints it.

    Attributes
    ----------
    name : str
        Letters, digits, spaces and ``._+-``, at most 80, the first a letter, digit or ``_``: it
        becomes the name of a folder.
    title : str
        One line for tables and reports.
    build : tuple of 3 floats, default z
        Build direction in the frame of the mesh.
    bed : BedLayout
        How the part, or copies of it, are turned and placed on the bed.
    slicing : Slicer, default 12 flat layers
        Cuts the part into layers of fibre.
    parameters : mapping of strategy name to parameters
        Parameters of strategies that should not use their defaults on this part.
    source : str
        Paper or person that the case comes from.
    alternative_supports : tuple of supports
        Another model of how the part is held, such as bolts that only press instead of walls that
        are held. If given, strategies are tested under both models, and no ranking is stated on
        which the two disagree.
    fibre : FibrePlaces, optional
        Which layers, and which regions of them, get fibre; by default all.
    weights : mapping of load case to float
        Weights of the load cases and combinations when all are planned for; those not named do not
        count. Default: all load cases equally, without combinations.
    plastic : Plastic
        Walls, skins, infill and seam; by default solid. `problem` has solid plastic, and
        `printed_problem` that which is printed.
    scatter : Scatter
        How far prints of the part differ.
    findings : tuple of str
        Problems found and repaired in a mesh from a file, one line each.
    body : BodyFaces, optional
        Faces of the mesh with the numbers that they have on the body it was made from.
    """

    name: str
    title: str
    problem: Problem
    build: tuple[float, float, float] = (0.0, 0.0, 1.0)
    slicing: Slicer = field(default_factory=Planar)
    machine: Machine = field(default_factory=Machine)
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    source: str = ""
    findings: tuple[str, ...] = ()
    alternative_supports: tuple[AnySupport, ...] = ()
    fibre: FibrePlaces | None = None
    plastic: Plastic = SOLID
    scatter: Scatter = DEFAULT_SCATTER
    weights: Mapping[str, float] = field(default_factory=dict)
    body: BodyFaces | None = None
    bed: BedLayout = AS_IT_STANDS

    def __repr__(self) -> str:
        return f"Case {self.name}: {self.title}"

    def __post_init__(self) -> None:
        freeze(self, parameters=dict, alternative_supports=tuple, weights=dict)
        object.__setattr__(self, "build", plain(self.build))
        for name, weight in self.weights.items():
            check_known("load case", name, self.problem.cases)
            check_number(f"weight of load case '{name}'", weight, above=0.0)
        check_name(self.name, self.title)

    def on_bed(self, table: Mapping[str, object]) -> "Case":
        """Case placed on the bed otherwise, by keys of a table ``[bed]``.

        Turns come after those that there are; about X and Y they change the build direction. Loads,
        supports and paths stay in the frame of the part.
        """
        build, bed = bed_of(self.build, table, self.bed)
        return replace(self, build=build, bed=bed)

    @cached_property
    def _flat_layers(self) -> dict[Planar, tuple[Layer, ...]]:
        """Flat layers that were cut already, by their slicer."""
        return {}

    def fibre_layers(self, stress: PartStress, slicer: Slicer | None = None) -> tuple[Layer, ...]:
        """Cut the part into the layers that get fibre, by its own slicer or another."""
        chosen = self.slicing if slicer is None else slicer
        if isinstance(chosen, Planar) and stress.mesh is self.problem.mesh:
            chosen.check(stress.mesh, self.build, self.machine)
            return self.known_layers(chosen)
        layers = chosen(stress, self.build, self.machine)
        if self.fibre is None:
            return layers
        return self.fibre.on(layers, stress.mesh, self.machine)

    def check_layers(self, slicer: Slicer | None = None) -> None:
        """Refuse layers that cannot be cut or planned on, before the part is solved.

        Raises
        ------
        InputError
            For what the slicer refuses whatever the stress is. Of flat layers: those outside the
            part or nearer to each other than a strand is high, places of fibre on none of them, and
            more strands than are planned.
        """
        chosen, mesh = self.slicing if slicer is None else slicer, self.problem.mesh
        if not isinstance(chosen, Planar):
            check = getattr(chosen, "check", None)
            if check is not None:
                check(mesh, self.build, self.machine)
            return
        heights = chosen.check(mesh, self.build, self.machine)
        many = about_strands(mesh, len(heights), self.build, self.machine) > MOST_STRANDS
        if many or self.fibre is not None:
            check_strands(self.known_layers(chosen), self.machine)

    def known_layers(self, slicer: Slicer | None = None) -> tuple[Layer, ...]:
        """Layers that get fibre, where they are known before the part is solved: flat ones.

        They are cut once.
        """
        chosen = self.slicing if slicer is None else slicer
        if not isinstance(chosen, Planar):
            return ()
        if chosen not in self._flat_layers:
            mesh = self.problem.mesh
            layers = chosen.cut(mesh, self.build)
            if self.fibre is not None:
                layers = self.fibre.on(layers, mesh, self.machine)
            self._flat_layers[chosen] = layers
        return self._flat_layers[chosen]

    def printed_problem(self, slicer: Slicer | None = None) -> Problem:
        """Problem of the plastic as it is printed: what is not there carries and weighs nothing.

        Solid plastic leaves the problem as it is.

        Raises
        ------
        InputError
            For infill other than solid between curved layers, and in a material that is not
            isotropic.
        """
        chosen = self.slicing if slicer is None else slicer
        if self.plastic.solid:
            return self.problem
        if not isinstance(chosen, Planar):
            raise InputError(
                f"plastic.infill '{self.plastic.infill}' goes with flat layers, whose fibre is "
                f"known before the part is solved; got the slicer {member_name(chosen)}: choose "
                "--slicing planar, or infill = 'solid'"
            )
        chosen.check(self.problem.mesh, self.build, self.machine)
        machine = spun(self.machine, self.bed.spin)  # infill keeps its direction on the bed
        return as_printed(self.problem, self.known_layers(chosen), self.plastic, machine)


def check_name(name: str, title: str) -> None:
    """Refuse a name that cannot be that of a folder, and a title that cannot be printed."""
    mistakes = Mistakes()
    if not re.fullmatch(r"\w[\w .+-]{0,79}", name):
        mistakes.lines.append(
            "the name of a case must have letters, digits, spaces and ._+- alone, at most 80, "
            f"and begin with a letter or digit; got {name[:90]!r}: rename it"
        )
    if not title.isprintable():
        mistakes.lines.append(
            f"the title of a case must be one printable line; got {shown(title)}: rewrite it"
        )
    mistakes.complain()
