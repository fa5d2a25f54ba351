"""The shared evaluator: every strategy is measured the same way."""

from ccfem.evaluation.column import Column
from ccfem.evaluation.evaluation import COLUMNS, Evaluation, FibreSamples, evaluate

__all__ = ["COLUMNS", "Column", "Evaluation", "FibreSamples", "evaluate"]
