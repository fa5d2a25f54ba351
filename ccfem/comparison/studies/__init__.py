"""Studies: parts x slicings x strategies x parameters, each run stored by what it depends on."""

from ccfem.comparison.studies.definition import Study, read_study
from ccfem.comparison.studies.running import study
from ccfem.comparison.studies.study_result import StudyResult

__all__ = ["Study", "StudyResult", "read_study", "study"]
