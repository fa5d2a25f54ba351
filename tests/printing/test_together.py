"""Different parts in one file, read back from it."""

import numpy as np
import pytest

from benchmarks.print_checks.job import Job
from benchmarks.print_checks.together import findings
from ccfem.machine import machine_names
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.export.gcode import gcode
from ccfem.printing.together import arranged

VALUES = {"gcode": {"bed": [400.0, 300.0, 200.0]}, "process": {"brim_loops": 2}}
LOW = {**VALUES, "matrix_height": 0.3}
OTHER = (np.array([[3.0, 4.0], [3.0, 56.0], [21.0, 56.0]]), np.array([[12.0, 2.0], [12.0, 50.0]]))


@pytest.fixture(scope="module", params=machine_names())
def file(request, small_part):
    """Two plates and an upright bar of other layers in one file."""
    alone = {
        "plate": small_part(request.param, VALUES),
        "bar": small_part(
            request.param, LOW, OTHER, size=(24.0, 60.0, 3.0), heights=(0.85, 1.6, 2.3)
        ),
    }
    machine = alone["plate"].machine
    plans = [job.plan for job in alone.values()]
    plan = arranged(plans, [BedLayout(copies=(2,)), BedLayout()], machine, [*alone])
    nothing = (lambda _: None, lambda _: 0.0, 0.0)
    return Job(request.param, machine, plan, gcode(plan, machine), [], *nothing), alone


def test_every_part_is_what_it_is_alone(file):
    whole, alone = file
    assert [spot.name for spot in whole.plan.standing] == ["bar", "plate", "plate"]
    assert findings(whole, alone) == []
