"""The printer: its limits for paths, how it prints, and the G-code that its firmware expects."""

from ccfem.base.lazy_modules import submodules
from ccfem.machine.gcode_profile import FeedAxes, GcodeProfile
from ccfem.machine.kinematics import Kinematics
from ccfem.machine.limits import Limits
from ccfem.machine.machine import Machine
from ccfem.machine.named_machines import machine_from, machine_names, machine_table, updated
from ccfem.machine.print_process import Process
from ccfem.machine.speeds import SpeedTable
from ccfem.machine.supplies import Costs, Spools

__all__ = [
    "Costs",
    "FeedAxes",
    "GcodeProfile",
    "Kinematics",
    "Limits",
    "Machine",
    "Process",
    "SpeedTable",
    "Spools",
    "machine_from",
    "machine_names",
    "machine_table",
    "updated",
]

__getattr__ = submodules(__name__)
