"""Chen, Fang, Liao and Wang 2021: toolpaths from fields; ours beside theirs."""
