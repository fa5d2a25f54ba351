"""Exports: toolpaths in the formats of other programs."""
