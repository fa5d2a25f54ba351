"""Checks of tools: heat, changes, cuts, and words that the firmware knows."""

from benchmarks.print_checks.job import FILAMENT, PART, Job
from benchmarks.print_checks.motion import arc
from benchmarks.print_checks.printer import COLD, Run

__all__ = ["changes", "cuts", "heat", "words"]


def heat(job: Job, run: Run) -> list[str]:
    """Nothing is fed by a tool that was not waited for, and the other one cools."""
    wrong, machine = [], job.machine
    work = (machine.matrix_temperature, machine.fibre_temperature)
    standby = (machine.matrix_standby, machine.fibre_standby)
    for step in run.steps:
        ready = step.waited and step.heat >= max(work[max(step.tool, 0)], COLD)
        if (step.fed > 0.0 or step.lays) and not ready:
            wrong.append(f"tool {step.tool} lays at {step.heat:g} degrees: step {step.number}")
    for change in run.changes:
        if change.old >= 0 and change.told > standby[change.old]:
            wrong.append(f"tool {change.old} stays at {change.told:g} degrees")
    return wrong


def changes(job: Job, run: Run) -> list[str]:
    """Up, drawn back, given back, and primed beside the part."""
    wrong, debt = [], 0.0
    for step in run.steps:
        debt -= step.fed if step.tool == 0 and not step.length else 0.0
        if step.lays and step.tool == 0 and abs(debt) > 1e-4:
            wrong.append(f"{debt:g} mm are not given back at step {step.number}")
            break
    for change in run.changes[1:]:
        if change.z < change.highest + 5.0 - 1e-6:
            wrong.append(f"tool {change.new} is taken at {change.z:g} over {change.highest:g}")
    for change in run.changes:
        laid = 0.0
        for step in run.steps[change.at :]:
            if step.lays and (step.kind in PART or step.tool != change.new):
                break
            laid += step.fed * FILAMENT if step.lays else 0.0
        if change.new == 0 and laid < 10.0:
            wrong.append(f"{laid:.1f} mm3 are primed before the part")
    return wrong


def cuts(job: Job, run: Run) -> list[str]:
    """One cut a strand, the tail before its end, with no feed behind it; none too short."""
    wrong, machine = [], job.machine
    strands = run.strands()
    if len(run.cuts) != len(strands):
        wrong.append(f"{len(run.cuts)} cuts in {len(strands)} strands")
    for name, steps in strands.items():
        along = arc(steps)
        at = [along[k] for k, step in enumerate(steps) if step.cut][:1] or [along[-1]]
        if abs(along[-1] - at[0] - machine.tail) > 0.05:
            wrong.append(f"strand {name} of {along[-1]:.2f} mm is cut at {at[0]:.2f}")
        if any(step.fed for step in steps if step.cut):
            wrong.append(f"strand {name} is fed behind its cut")
        if along[-1] < machine.minimum_length - 0.01:
            wrong.append(f"strand {name} is {along[-1]:.2f} mm long")
    return wrong


def words(job: Job, run: Run) -> list[str]:
    """Only words that the firmware knows, and no feed longer than it takes."""
    return run.wrong
