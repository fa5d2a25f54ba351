"""What ``ccfem solve`` does: the stress of a part, written for ParaView and summed up."""

from pathlib import Path

from ccfem.base.checks import check_known
from ccfem.base.progress import progress_bar
from ccfem.base.whole import check_writable
from ccfem.cases.case import Case
from ccfem.cli.screen import print_solution
from ccfem.fem.elasticity.statics import solve
from ccfem.printing.export.vtu_result import result_path, write_result


def solve_part(case: Case, out: Path, load_case: str | None, backend: str) -> None:
    """Solve a part in one load case or all, write the results, and print what was found."""
    names = case.problem.cases
    if load_case is not None:
        check_known("load case", load_case, names)
        names = (load_case,)
    files = {name: out if len(names) == 1 else result_path(out, name) for name in names}
    for file in files.values():
        check_writable(result_path(file))
    with progress_bar(lines=True) as progress:
        fields = solve(case.printed_problem(), backend=backend, progress=progress)
    for name, file in files.items():
        write_result(fields[name], file)
        print_solution(fields[name], case.findings, file)
