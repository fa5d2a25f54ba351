"""The printer: what a path has to respect, how it prints, and what its firmware is told."""

from ccfem.machine.gcode_profile import FeedAxes, GcodeProfile
from ccfem.machine.kinematics import Kinematics
from ccfem.machine.limits import Limits
from ccfem.machine.machine import Machine
from ccfem.machine.named_machines import machine_from, machine_names, machine_table, updated
from ccfem.machine.print_process import Process
from ccfem.machine.speed_table import SpeedTable

__all__ = [
    "FeedAxes",
    "GcodeProfile",
    "Kinematics",
    "Limits",
    "Machine",
    "Process",
    "SpeedTable",
    "machine_from",
    "machine_names",
    "machine_table",
    "updated",
]
