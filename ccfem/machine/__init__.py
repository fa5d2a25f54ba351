"""The printer: what a path has to respect, how fast it is laid, and what its firmware is told."""

from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.machine.limits import Limits
from ccfem.machine.machine import Machine
from ccfem.machine.speed_table import SpeedTable

__all__ = ["GcodeProfile", "Limits", "Machine", "SpeedTable"]
