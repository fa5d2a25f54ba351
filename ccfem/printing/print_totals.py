"""Time and filament of a whole print: one count for the head of its file and for every table."""

from dataclasses import dataclass

import numpy as np

from ccfem.machine.machine import Machine
from ccfem.printing.duration import durations, waits
from ccfem.printing.moves import Moves


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
    """

    seconds: float
    heating: float
    fibre_seconds: float
    matrix_fed: float
    fibre_fed: float
    matrix_mass: float
    fibre_mass: float


def print_totals(moves: Moves, machine: Machine) -> PrintTotals:
    """Count what all moves of a print take."""
    moving = durations(moves, machine, heating=False)
    heating = float(waits(moving, moves, machine).sum())
    fibre_fed = float(moves.feed[moves.tool == 1].sum())
    matrix_fed = float(moves.feed[moves.tool == 0].sum() + moves.beside.sum())
    area = 0.25 * np.pi * machine.matrix_diameter**2
    return PrintTotals(
        float(moving.sum()) + heating,
        heating,
        float(moving[moves.tool == 1].sum()),
        matrix_fed,
        fibre_fed,
        1e-3 * matrix_fed * area * machine.matrix_density,
        fibre_fed * machine.fibre_mass_per_length,
    )
