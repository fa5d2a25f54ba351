"""All checks of a printed file, each of which says what is wrong, a line a finding."""

from benchmarks.print_checks.filling import amount, feeding, places, shapes, volume
from benchmarks.print_checks.motion import air, bed, speeds, support, travel
from benchmarks.print_checks.tooling import changes, cuts, heat, words

__all__ = ["CHECKS"]

CHECKS = (
    *(volume, feeding, shapes, speeds, heat, changes, travel, support, bed, cuts, amount, places),
    words,
    air,
)
