"""The call in Python that does what a command does, said by the help of each."""

import typer

CALLS = {
    "cases": "ccfem.cases.named_cases()",
    "strategies": "ccfem.strategies.named()",
    "slicers": "ccfem.slicing.slicers.named()",
    "machines": "ccfem.machine.machine_names()",
    "faces": "ccfem.faces(BODY)",
    "check": "ccfem.check(CASE)",
    "mesh": "ccfem.body.meshing.mesh_body(BODY, SIZE)",
    "optimise": "ccfem.cases.optimise(CASE, VOLUME_FRACTION)",
    "compare": "ccfem.compare(CASE, [A, B]), and ccfem.save(comparison, DIR)",
    "plan": "ccfem.compare(CASE, [S], natural=True), or ccfem.plan(STRATEGY, LAYERS, STRESS)",
    "solve": "ccfem.solve(CASE.problem)",
    "calibrate": "ccfem.calibrate(PROBLEM, CURVE)",
    "reproduce": "ccfem.reproduce(PAPER, PART)",
    "new": "ccfem.cases.inspection.new_part(BODY)",
    "example": "ccfem.cases.inspection.write_example(NAME)",
    "cite": "ccfem.comparison.bibtex(ccfem.comparison.cited([METHOD]))",
    "front": "ccfem.comparison.fibre_front(CASE, STRESS, NAME, STRATEGY, COUNTS)",
    "study": "ccfem.study(FILE, workers=N)",
    "support": "ccfem.printing.support.slice_with_support(SLICER, STRESS, BUILD)",
}
"""Call of each command, as its help prints it."""


def say_in_python(app: typer.Typer) -> None:
    """Let the help of each command end with its call."""
    for command in app.registered_commands:
        name = command.name or (command.callback.__name__ if command.callback else "")
        if name in CALLS:
            command.epilog = f"In Python: {CALLS[name]}"
