"""Limits of a printer: paths that exceed one of them cannot be printed as they are."""

from dataclasses import dataclass

from ccfem.machine.ranges import check_ranges


@dataclass(frozen=True)
class Limits:
    """Largest shares and lengths of defects that can still be printed.

    In a part file ``[machine.limits]``. All are our choice: above the values measured on the paths
    that Chen et al. 2021 printed (Loop, "ours" and "zigzag"), and below values at which a design
    makes no sense.

    Attributes
    ----------
    short : float
        Share of the fibre's length in paths shorter than `Machine.shortest_strand`.
    tight : float
        Share of the fibre's length that turns tighter than `Machine.minimum_radius`.
    on_fibre : float
        Share of the fibre that lies on other fibre of its direction.
    across_fibre : float
        Share of the fibre that lies on fibre that it crosses.
    outside : float
        Share of the strands, by their width, that lies outside the part.
    outside_height : float
        Share of the fibre's length at which strands stand out of the part's top or bottom.
    free_span : float, mm
        Longest run of fibre with nothing below it.
    links : float
        Share of the fibre's length that is marked as links.
    fraction : float
        Fibre volume fraction that 99 % of the fibre's length stays at or below.
    overhang : float, degrees
        Faces that lean over by more than this, from upright, are laid in air by flat layers,
        except over gaps no wider than `free_span`; 90 allows all.
    """

    short: float = 0.01
    tight: float = 0.2
    on_fibre: float = 0.1
    across_fibre: float = 0.15
    outside: float = 0.1
    outside_height: float = 0.03
    free_span: float = 8.0
    links: float = 0.3
    fraction: float = 1.0
    overhang: float = 45.0

    def __post_init__(self) -> None:
        check_ranges(self)
