"""Writing a comparison to a folder, as the command line does."""

import os
from pathlib import Path

from ccfem.comparison.files import RESULT_FILES, write_results
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
    """Write the report, tables and paths of a comparison: all files or none.

    Parameters
    ----------
    comparison : Comparison or SlicingComparison
    folder : path
        In an existing folder only files that ccfem wrote, and nobody has changed, are replaced.
    force : bool, default False
        Also replace files of the same names that others wrote or changed.
    progress : callable, optional

    Returns
    -------
    Path
        Of the report, ``report.html``.

    Raises
    ------
    InputError
        When the folder cannot be written to, or holds files that would be overwritten.
    """
    folder, command = Path(folder), "ccfem.save(comparison) in Python"
    with whole_folder(folder, RESULT_FILES, force) as temporary:
        if isinstance(comparison, SlicingComparison):
            write_slicings(comparison, temporary, command, {}, progress)
        else:
            write_results(comparison, temporary, command, {}, progress)
    return folder / "report.html"
