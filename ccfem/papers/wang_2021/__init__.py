"""Wang et al. 2021: load-dependent path planning; ours beside theirs."""
