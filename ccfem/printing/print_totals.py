"""Time, filament and cost of a whole print: one count for the head of its file and every table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.machine.machine import Machine
from ccfem.printing.duration import durations, waits
from ccfem.printing.moves import LAY, TRAVEL, Moves
from ccfem.printing.print_plan import Standing

_TOGETHER = 500_000
"""Rows whose layers are looked at a time: those of a large print fill memory."""
_ROUNDING = 1e-3
"""Of places in moves, mm."""


@dataclass(frozen=True)
class SpoolUse:
    """What a print takes of one kind of spool.

    Attributes
    ----------
    what : str
        "fibre", "matrix" or "coextruded".
    length : float, m
        That is fed.
    full, left : float, m
        On a full spool, and on the last one when the print ends.
    count : int
        Spools, that in the machine included.
    changes : tuple of (int, int)
        Layer before which a spool is changed, and how many strands or lines of this layer are laid
        before: 0, unless one layer takes more than a spool. No strand or line is broken.
    longest : float, m
        Longest strand or line: none longer than a spool can be laid whole.
    """

    what: str
    length: float
    full: float
    left: float
    count: int
    changes: tuple[tuple[int, int], ...]
    longest: float

    @property
    def words(self) -> str:
        """Line that says all of it."""
        if self.longest > self.full:
            return (
                f"{self.what}: one piece takes {self.longest:.2f} m, more than the "
                f"{self.full:.4g} m of a spool: set a longer one in machine.spools, or plan "
                "shorter strands"
            )
        places = [
            f"layer {layer}" + (f" and its piece {piece}" if piece else "")
            for layer, piece in self.changes
        ]
        changed = f", change before {', '.join(places)}" if places else ""
        return (
            f"{self.what}: {self.length:.2f} m, needs {self.count} "
            f"spool{'s' * (self.count > 1)}{changed}; {self.left:.2f} m are left"
        )


@dataclass(frozen=True)
class PartTotals:
    """What a part on the bed takes of a print, without changes of tools and what is beside it.

    Attributes
    ----------
    name : str
    count : int
        How often it stands on the bed: all else is of all of these.
    seconds : float, s
        Of its lines and strands, with the ways to them.
    fibre : float, m
        That is fed for its strands, up to their cuts.
    fibre_mass, matrix_mass : float, g
    """

    name: str
    count: int
    seconds: float
    fibre: float
    fibre_mass: float
    matrix_mass: float


@dataclass(frozen=True)
class PrintTotals:
    """What a print takes.

    Attributes
    ----------
    seconds : float, s
        Of the whole print, waits for tools included; the first heating is left out.
    heating : float, s
        Of it, waits for tools.
    fibre_seconds : float, s
        Of it, moves, feeds and cuts of the fibre's tool.
    matrix_fed, fibre_fed : float, mm
        Filament, that beside the part included.
    matrix_mass, fibre_mass : float, g
    by_layer : mapping of int to float, s
        Of it, each layer.
    spools : tuple of SpoolUse
        Of kinds whose length is known (`ccfem.machine.Spools`).
    cost : mapping of str to float
        Of "matrix", "fibre" and "machine", where they have prices (`ccfem.machine.Costs`).
    currency : str
    parts : tuple of PartTotals
        Shares of the parts on the bed, in the order of their names.
    """

    seconds: float
    heating: float
    fibre_seconds: float
    matrix_fed: float
    fibre_fed: float
    matrix_mass: float
    fibre_mass: float
    by_layer: Mapping[int, float] = field(default_factory=dict)
    spools: tuple[SpoolUse, ...] = ()
    cost: Mapping[str, float] = field(default_factory=dict)
    currency: str = ""
    parts: tuple[PartTotals, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """Lines on spools and cost; none where nothing is known of them."""
        lines = [spool.words for spool in self.spools]
        if self.cost:
            unit = f" {self.currency}" if self.currency else ""
            parts = ", ".join(f"{what} {price:.2f}" for what, price in self.cost.items())
            lines.append(f"cost: {sum(self.cost.values()):.2f}{unit} ({parts})")
        return tuple(lines)


def print_totals(moves: Moves, machine: Machine, standing: Sequence[Standing] = ()) -> PrintTotals:
    """Count what all moves of a print take, and of them the parts that stand on the bed."""
    moving = durations(moves, machine, heating=False)
    waiting = waits(moving, moves, machine)
    heating = float(waiting.sum())
    fibre_fed = float(moves.feed[moves.tool == 1].sum())
    matrix_fed = float(moves.feed[moves.tool == 0].sum() + moves.beside.sum())
    area = 0.25 * np.pi * machine.matrix_diameter**2
    seconds = float(moving.sum()) + heating
    mass = 1e-3 * matrix_fed * area * machine.matrix_density
    parts = part_totals(moving, moves, machine, standing)
    prices = machine.costs
    cost = {
        "matrix": (prices.matrix, 1e-3 * mass),
        "fibre": (prices.fibre, 1e-3 * fibre_fed),
        "machine": (prices.hour, seconds / 3600.0),
    }
    return PrintTotals(
        seconds,
        heating,
        float(moving[moves.tool == 1].sum()),
        matrix_fed,
        fibre_fed,
        mass,
        fibre_fed * machine.fibre_mass_per_length,
        layer_seconds(np.add(moving, waiting, out=moving), moves),
        spool_uses(moves, machine),
        {what: price * much for what, (price, much) in cost.items() if price is not None},
        prices.currency,
        parts,
    )


def part_totals(
    moving: FloatArray, moves: Moves, machine: Machine, standing: Sequence[Standing]
) -> tuple[PartTotals, ...]:
    """Count what parts on the bed take, where all rows take some seconds (n,) without heating.

    A row belongs to the part whose line or strand it lays, or leads to.
    """
    names = list(dict.fromkeys(spot.name for spot in standing))
    if not names:
        return ()
    owner = np.full(len(moves), -1)
    for spot in standing:
        low, high = np.array(spot.low) - _ROUNDING, np.array(spot.high) + _ROUNDING
        place = moves.place[:, :2]
        owner[((place >= low) & (place <= high)).all(axis=1)] = names.index(spot.name)
    printed = np.flatnonzero(moves.event == LAY)
    following = np.searchsorted(printed, np.arange(len(moves)))
    owner = np.append(owner[printed], -1)[following]
    area = 0.25e-3 * np.pi * machine.matrix_diameter**2 * machine.matrix_density
    parts = []
    for k, name in enumerate(names):
        mine = owner == k
        fibre = float(moves.feed[mine & (moves.tool == 1)].sum())
        lines = mine & (moves.event == LAY)  # what is drawn back comes again
        matrix = float(moves.feed[lines & (moves.tool == 0)].sum() + moves.beside[lines].sum())
        count = sum(spot.name == name for spot in standing)
        mass = fibre * machine.fibre_mass_per_length
        seconds = float(moving[mine].sum())
        parts.append(PartTotals(name, count, seconds, 1e-3 * fibre, mass, area * matrix))
    return tuple(parts)


def layer_seconds(seconds: FloatArray, moves: Moves) -> dict[int, float]:
    """Seconds of each layer, in the order of printing, of those of every row (n,)."""
    changes = list[int]()
    for first in range(0, len(moves), _TOGETHER):
        layer = moves.layer[max(first - 1, 0) : first + _TOGETHER]
        changes += (np.flatnonzero(layer[1:] != layer[:-1]) + max(first, 1)).tolist()
    total: dict[int, float] = {}
    for begin, end in pairwise([0, *changes, len(moves)] if len(moves) else []):
        number = int(moves.layer[begin])
        # One after the other, as over all rows at once, where a layer goes on after others.
        of_layer = np.append(total.get(number, 0.0), seconds[begin:end])
        total[number] = float(np.bincount(np.zeros(len(of_layer), dtype=np.int64), of_layer)[0])
    return total


def spool_uses(moves: Moves, machine: Machine) -> tuple[SpoolUse, ...]:
    """Find what is taken of every kind of spool whose length is known."""
    spools = machine.spools
    if not (spools.fibre or spools.matrix or spools.coextruded):
        return ()
    fed = {
        "fibre": (np.where(moves.tool == 1, moves.feed, 0.0), spools.fibre, spools.fibre_left),
        "matrix": (np.where(moves.tool == 0, moves.feed, 0.0), spools.matrix, spools.matrix_left),
        "coextruded": (moves.beside, spools.coextruded, spools.coextruded_left),
    }
    # A piece is what is fed between two ways through the air: a strand with its first feed, a line.
    piece = np.cumsum(moves.event == TRAVEL)
    _, rows = np.unique(piece, return_index=True)
    layers = moves.layer[rows]
    return tuple(
        _use(what, 1e-3 * np.bincount(piece, feed)[piece[rows]], layers, full, left)
        for what, (feed, full, left) in fed.items()
        if full
    )


def _use(
    what: str, pieces: FloatArray, layers: IntArray, full: float, left: float | None
) -> SpoolUse:
    """Take pieces (k,), m, from spools; one is changed before a layer for which it is too short."""
    rest = full if left is None else left
    changes: list[tuple[int, int]] = []
    for layer in layers[np.sort(np.unique(layers, return_index=True)[1])].tolist():
        lengths = pieces[layers == layer]
        lengths = lengths[lengths != 0.0]
        if lengths.sum() > rest and rest < full:
            changes.append((layer, 0))
            rest = full
        if lengths.sum() <= rest:
            rest -= float(lengths.sum())
            continue
        for number, length in enumerate(lengths.tolist()):
            if length > rest:
                changes.append((layer, number))
                rest = full
            rest -= length
    longest = float(pieces.max(initial=0.0))
    return SpoolUse(
        what, float(pieces.sum()), full, rest, len(changes) + 1, tuple(changes), longest
    )
