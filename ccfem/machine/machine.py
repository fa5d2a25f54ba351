"""The printer: what paths have to respect, and what they cost."""

from dataclasses import dataclass, field

from ccfem.base.arrays import in_brief
from ccfem.base.errors import InputError
from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.machine.kinematics import Kinematics
from ccfem.machine.limits import Limits
from ccfem.machine.print_process import Process
from ccfem.machine.ranges import check_ranges
from ccfem.machine.speeds import SpeedTable
from ccfem.machine.supplies import Costs, Spools

_CUTTER_DISTANCE = 42.0
"""Chen et al. 2021, section 5.2, mm."""


_WIDTHS = (0.8, 2.5)
"""Least and largest width of a line, over the bore of its nozzle. Our choice."""


@dataclass(frozen=True)
class Machine:
    """A printer of continuous fibre.

    The defaults are the machine of Chen et al. 2021 (section 5 and table 3). Values that the paper
    does not state are marked "our choice".

    Attributes
    ----------
    fibre_width : float, mm
        W, the minimum distance between neighbouring strands.
    fibre_height : float, mm
        Least height of a fibre layer. If the cross-section of the filament needs more height at the
        fibre width, that height applies: see `strand_height`.
    matrix_height : float, mm
        Height of a matrix layer between two fibre layers.
    pressed : bool
        Strands are pressed into the layer below, so that `fibre_height` applies although their
        cross-section needs more.
    filament_area : float, mm^2
        Cross-section of one strand.
    minimum_length : float, mm
        Shortest strand that the cutter allows.
    held_length : float, mm
        Least length that lies, without a fold, between the start of a strand and its cut, so that
        the strand holds. Default: 0, since the paper lays strands of 42 mm, the distance from its
        cutter.
    minimum_radius : float, mm
        Tightest turn that a strand follows without folding; 0.26 1/mm in curvature.
    fibre_speed, matrix_speed, travel_speed : float, mm/s
        Travel: our choice.
    fibre_temperature, matrix_temperature : float, degrees Celsius
    speeds : SpeedTable, optional
        Speed of the fibre by curvature, length and angle of a path's pieces, in place of
        `fibre_speed`. Default: none.
    cutter_distance : float, mm, optional
        From the cutter to the tip of the fibre nozzle. Default: 42 mm, or `minimum_length` where
        that is shorter (section 5.2: no shorter strand can be cut).
    cut_wait : float, s
        Standstill after a cut. Our choice.
    matrix_width : float, mm
        Width of a line of matrix.
    matrix_nozzle : float, mm, optional
        Bore of the matrix nozzle. Default: `matrix_width`.
    line_shape : float
        Largest height of a line of matrix over its width. The paper's lines are as high as wide.
    least_line : float, mm
        Least height of a line of matrix. Our choice.
    matrix_diameter : float, mm
        Of the matrix filament.
    fibre_density, matrix_density : float, g/cm^3
        Our choice: a data sheet's value for carbon tow in thermoplastic, and that of PLA.
    fibre_tex : float, g/km, optional
        Mass of the fibre filament, used instead of its density and cross-section.
    coextrusion : float
        Share of the free space in a strand's cell, `fibre_width` times the layer height, that the
        fibre head fills with matrix of its own; 0 for a head that lays fibre only.
    bed_temperature : float, degrees Celsius
        Our choice, usual for PLA.
    matrix_standby, fibre_standby : float, degrees Celsius
        Temperature of a tool while the other one prints (Aura: 100 and 180).
    matrix_heating, fibre_heating : float, K/s
        How fast a nozzle heats up again (Aura: 0.97 and 1.38).
    head_angle, head_length : float, degrees and mm
        Half the tip angle, and the length, of the cone that represents the head in the search for
        collisions on curved layers. Our choice.
    gcode : GcodeProfile
        The G-code that its firmware expects.
    process : Process
        How it prints.
    kinematics : Kinematics
        How it rotates head and part relative to each other on curved layers.
    limits : Limits
        What it tolerates: paths beyond these limits are not printable as they are.
    spools : Spools
        Lengths on its spools.
    costs : Costs
        Prices of material and hours.
    """

    fibre_width: float = 1.0
    fibre_height: float = 0.05
    matrix_height: float = 0.8
    pressed: bool = False
    filament_area: float = 0.1075
    minimum_length: float = 42.0
    held_length: float = 0.0
    minimum_radius: float = 3.85
    fibre_speed: float = 5.0
    matrix_speed: float = 12.0
    travel_speed: float = 80.0
    fibre_temperature: float = 250.0
    matrix_temperature: float = 200.0
    speeds: SpeedTable | None = None
    cutter_distance: float | None = None
    cut_wait: float = 1.0
    matrix_width: float = 0.8
    matrix_nozzle: float | None = None
    line_shape: float = 1.0
    least_line: float = 0.05
    matrix_diameter: float = 1.75
    fibre_density: float = 1.4
    matrix_density: float = 1.24
    fibre_tex: float | None = None
    coextrusion: float = 0.0
    bed_temperature: float = 60.0
    matrix_standby: float = 100.0
    fibre_standby: float = 180.0
    matrix_heating: float = 0.97
    fibre_heating: float = 1.38
    head_angle: float = 35.0
    head_length: float = 40.0
    gcode: GcodeProfile = field(default_factory=GcodeProfile)
    process: Process = field(default_factory=Process)
    kinematics: Kinematics = field(default_factory=Kinematics)
    limits: Limits = field(default_factory=Limits)
    spools: Spools = field(default_factory=Spools)
    costs: Costs = field(default_factory=Costs)

    __repr__ = in_brief

    def __post_init__(self) -> None:
        check_ranges(self)
        least, most = (factor * (self.matrix_nozzle or self.matrix_width) for factor in _WIDTHS)
        if not least <= self.matrix_width <= most:
            raise InputError(
                f"machine.matrix_width must be from {least:.3g} to {most:.3g} mm, {_WIDTHS[0]:g} "
                f"to {_WIDTHS[1]:g} bores of machine.matrix_nozzle; got {self.matrix_width:g}: "
                "correct one of them"
            )
        if self.least_line > self.highest_line:
            raise InputError(
                f"machine.least_line must be at most the {self.highest_line:.3g} mm that "
                f"line_shape allows a line to be high; got {self.least_line:g}: give less"
            )

    @property
    def highest_line(self) -> float:
        """Largest height of a line of matrix, mm: what its shape allows at its width."""
        return self.line_shape * self.matrix_width

    def highest_matrix(self, over: float) -> float:
        """Largest height, mm, of a layer of matrix whose lines fill what is open below them too.

        They reach down between strands over a height of the fibre layer below; 0 on matrix.
        """
        highest = max(self.highest_line - over, min(self.least_line, self.highest_line))
        return min(self.matrix_height, highest) if self.matrix_height else highest

    @property
    def strand_height(self) -> float:
        """Least height of a layer of strands a fibre width apart, mm: what their volume needs."""
        if self.pressed:
            return self.fibre_height
        return max(self.fibre_height, self.filament_area / self.fibre_width)

    @property
    def strand_area(self) -> float:
        """Cross-section of a laid strand, mm^2: the filament and the matrix round it."""
        room = self.fibre_width * self.strand_height - self.filament_area
        return self.filament_area + self.coextrusion * max(room, 0.0)

    @property
    def fibre_mass_per_length(self) -> float:
        """Mass of the fibre filament, g/mm: by `fibre_tex`, else by density and cross-section."""
        if self.fibre_tex is not None:
            return 1e-6 * self.fibre_tex
        return 1e-3 * self.fibre_density * self.filament_area

    @property
    def shortest_strand(self) -> float:
        """Shortest strand that is laid, mm: what the cutter allows, and what holds before a cut."""
        return max(self.minimum_length, self.tail + self.held_length)

    @property
    def shortest_strand_by(self) -> str:
        """What decides the length of the shortest strand, in words for messages."""
        if self.shortest_strand <= self.minimum_length:
            return "machine.minimum_length"
        return f"machine.held_length, {self.held_length:g} mm, and {self.tail:g} mm from the cutter"

    @property
    def tail(self) -> float:
        """Length of fibre still to be laid after a cut, mm."""
        if self.cutter_distance is None:
            return min(_CUTTER_DISTANCE, self.minimum_length)
        return self.cutter_distance
