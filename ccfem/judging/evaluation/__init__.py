"""The shared evaluator: every strategy is measured the same way."""

from ccfem.judging.evaluation.column import Column
from ccfem.judging.evaluation.evaluation import COLUMNS, Evaluation, FibreSamples, evaluate

__all__ = ["COLUMNS", "Column", "Evaluation", "FibreSamples", "evaluate"]
