"""The shared evaluator: every strategy is measured the same way."""

from ccfem.evaluate.column import Column
from ccfem.evaluate.evaluation import COLUMNS, Evaluation, evaluate

__all__ = ["COLUMNS", "Column", "Evaluation", "evaluate"]
