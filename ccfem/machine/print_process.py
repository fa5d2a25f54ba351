"""How a machine prints: speeds of a strand, tools that wait, what is laid beside the part."""

from dataclasses import dataclass
from typing import Literal

from ccfem.base.checks import check_choices
from ccfem.machine.ranges import check_ranges


@dataclass(frozen=True)
class Process:
    """Rules of printing, in a part file ``[machine.process]``.

    The defaults follow what an Aura session of a Composer A4 holds, where it says something; all
    else is our choice, to be tried on the printer.

    Attributes
    ----------
    restart_extra : float, mm
        Fibre that is fed before a strand beyond the distance from cutter to nozzle (Aura: 1).
    feed_ratio : float
        Fibre that is fed for each mm of a strand, up to its cut; less is more tension.
    start_speed, start_length, ramp_length : float, mm/s and mm
        A strand begins this slow over this length (Aura: 1 to 3 mm/s over 20 mm), and then becomes
        faster along the ramp.
    start_wait : float, s
        Standstill after the feed, so that the strand sticks.
    bend_radius : float, mm
        Where no speed table is given, a strand is laid at `start_speed` in turns of
        `Machine.minimum_radius` and at `Machine.fibre_speed` from this radius on, in between
        linearly.
    speed_limit : float, mm/s, optional
        Of fibre, whatever its table allows. Default: none.
    corner_angle, corner_length : float, degrees and mm
        Where a strand turns by more, it is laid at `start_speed` this far on both sides.
    finish_speed : float, mm/s
        Most from the cut to the end of a strand (Aura: 1 to 8).
    ironing_length : float, mm
        The nozzle goes back over so much of the strand's end without feeding. Companies hold
        patents on cutting and ironing.
    strand_lift : float, mm
        The nozzle rises so much more than `GcodeProfile.lift` after a strand.
    tool_lift, tool_retract, tool_fibre_retract : float, mm
        Before a change of tools the nozzle rises so far above all that is printed, and so much
        matrix filament of the matrix head, and of the fibre head, is drawn back (Aura: 5, 15, 12).
    short : {"matrix", "drop", "error"}
        Strands below `Machine.shortest_strand`: laid by the matrix nozzle, left out, or refused.
    cover : float, mm
        Least height of matrix below the first and over the last layer of fibre.
    turns : {"pad", "cut", "inside"}
        Strands that leave the part: on pads of matrix that are cut off behind the print, cut at the
        border, or refused.
    stacks : {"keep", "end"}
        Strands that cross or join and stand higher than the matrix above them: kept, with a warning
        from 1 % of a layer on and refused above 10 %; or they end there alternately.
    prime : {"block", "line", "none"}
        After a change of tools matrix comes first on a block beside the part, or on a line of it
        (as long as the block's contour). The first strand lies beside the part, on a bar of matrix.
    prime_volume, prime_size : float, mm^3 and mm
        Least volume of matrix that is laid there after a change, and the side of the block.
    skirt_loops, skirt_gap : int and float, mm
        Loops round the first layer, and their distance to it.
    brim_loops : int
        Loops that touch the first layer.
    support_interface : int
        Solid layers of pads, and of support, right below what lies on them.
    support_gap : float, mm
        Least height between support and the part on it, in whole layers of matrix.
    support_clearance : float, mm
        Distance of pads and support to the walls of the part (Aura: 0.7).
    first_layer_height : float, mm
        Of matrix on the bed, where there is more room; 0 to make it as high as the others.
    first_layer_speed : float
        Speed of matrix there over that of other layers.
    warm_height, warm_matrix, warm_bed : float, mm and degrees
        Up to this height matrix and bed are so much hotter, and the fans are off.
    matrix_fan, fibre_fan : float
        Share of the fans' power above it.
    acceleration, junction : float, mm/s^2 and mm
        For the estimate of the time: acceleration, and how far a corner may be cut
        (junction deviation).
    """

    restart_extra: float = 1.0
    feed_ratio: float = 1.0
    start_speed: float = 2.0
    start_length: float = 20.0
    ramp_length: float = 10.0
    start_wait: float = 0.0
    bend_radius: float = 20.0
    speed_limit: float | None = None
    corner_angle: float = 45.0
    corner_length: float = 2.0
    finish_speed: float = 5.0
    ironing_length: float = 0.0
    strand_lift: float = 0.5
    tool_lift: float = 5.0
    tool_retract: float = 15.0
    tool_fibre_retract: float = 0.0
    short: Literal["matrix", "drop", "error"] = "matrix"
    cover: float = 0.15
    turns: Literal["pad", "cut", "inside"] = "pad"
    stacks: Literal["keep", "end"] = "keep"
    prime: Literal["block", "line", "none"] = "block"
    prime_volume: float = 10.0
    prime_size: float = 10.0
    skirt_loops: int = 2
    skirt_gap: float = 6.0
    brim_loops: int = 0
    support_interface: int = 2
    support_gap: float = 0.0
    support_clearance: float = 0.7
    first_layer_height: float = 0.2
    first_layer_speed: float = 0.5
    warm_height: float = 0.5
    warm_matrix: float = 10.0
    warm_bed: float = 5.0
    matrix_fan: float = 1.0
    fibre_fan: float = 0.5
    acceleration: float = 1000.0
    junction: float = 0.02

    def __post_init__(self) -> None:
        check_choices(self)
        check_ranges(self)
