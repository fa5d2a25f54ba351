"""Studies: parts x slicings x strategies x parameters, each run stored by what it depends on."""

from ccfem.studies.definition import Study, read_study
from ccfem.studies.result import StudyResult
from ccfem.studies.run import study

__all__ = ["Study", "StudyResult", "read_study", "study"]
