"""Layers, and slicing."""
