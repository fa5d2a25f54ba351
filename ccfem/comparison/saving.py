"""A comparison written to a folder, as the command line does it."""

import os
from pathlib import Path

from ccfem.comparison.files import write_results
from ccfem.comparison.result import Comparison
from ccfem.comparison.slicings import SlicingComparison
from ccfem.comparison.slicings_files import write_slicings
from ccfem.io.result_folder import whole_folder
from ccfem.progress import Progress, silent

__all__ = ["save"]


def save(
    comparison: Comparison | SlicingComparison,
    folder: str | os.PathLike[str],
    force: bool = False,
    progress: Progress = silent,
) -> Path:
    """Write the report, tables and paths of a comparison, all of them or none.

    Parameters
    ----------
    comparison : Comparison or SlicingComparison
    folder : path
        Of earlier results, only files that ccfem wrote and nobody changed since are replaced.
    force : bool, default False
        Replace files of the same names whoever wrote them.
    progress : callable, optional

    Returns
    -------
    Path
        Of the report, ``report.html``.

    Raises
    ------
    InputError
        When the folder cannot be written to, or holds files of others.
    """
    folder, command = Path(folder), "ccfem.save(comparison) in Python"
    with whole_folder(folder, force) as temporary:
        if isinstance(comparison, SlicingComparison):
            write_slicings(comparison, temporary, command, {}, progress)
        else:
            write_results(comparison, temporary, command, {}, progress)
    return folder / "report.html"
