"""The shared evaluator: every strategy is measured the same way."""
