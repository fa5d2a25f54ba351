"""Fang et al. 2024: curved layers, strands round the joints; ours beside theirs."""
