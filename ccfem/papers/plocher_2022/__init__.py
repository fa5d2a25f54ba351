"""Plocher, Wioland and Panesar 2022: infill patterns; ours beside theirs."""
