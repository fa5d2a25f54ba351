"""Comparison of strategies on one part: runs, ranking, pictures, report and files."""
