"""The shared evaluator: every strategy is measured the same way."""

from ccfem.judging.evaluation.evaluation import COLUMNS, Evaluation, FibreSamples, evaluate
from ccfem.judging.evaluation.layer_paths import Column

__all__ = ["COLUMNS", "Column", "Evaluation", "FibreSamples", "evaluate"]
