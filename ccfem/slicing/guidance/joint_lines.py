"""Stress lines between joints, traced once and shared by all that use the same stress."""

from collections.abc import Sequence
from typing import NamedTuple

from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.slicing.guidance.joints import Joint, joining_pairs
from ccfem.slicing.principal_lines.critical import CriticalRegion, Keep, critical_region
from ccfem.slicing.principal_lines.strongest import Strongest, strongest_stress

_KNOWN = "_joint_lines"


class JointLines(NamedTuple):
    """Strongest stress of the cells, and the region where lines along it join joints."""

    strongest: Strongest
    region: CriticalRegion


def joint_lines(stress: PartStress, joints: Sequence[Joint], keep: Keep) -> JointLines:
    """Trace the lines of the strongest stress from every cell; the stress stores the result.

    Parameters
    ----------
    keep : {"joining", "touching", "all"}
        As in `critical_region`.

    Raises
    ------
    InputError
        As in `critical_region`.
    """
    known = vars(stress).setdefault(_KNOWN, {})
    key = (tuple(joint.name for joint in joints), keep)
    if key not in known:
        strongest = strongest_stress(stress.stress)
        walls, pairs = [joint.wall for joint in joints], joining_pairs(joints, stress)
        region = critical_region(stress.mesh, strongest.direction, walls, pairs, keep)
        known[key] = JointLines(strongest, region)
    lines: JointLines = known[key]
    return lines
