"""Parts of the report that several of its sections use."""

import base64
from collections.abc import Sequence
from html import escape

import numpy as np

__all__ = ["figure", "grid", "number"]


def grid(figures: Sequence[str]) -> str:
    """Figures side by side."""
    columns = f"grid-template-columns: repeat({max(len(figures), 2)}, 1fr)"
    return f'<div class="pictures" style="{columns}">{"".join(figures)}</div>'


def figure(image: bytes, about: str) -> str:
    """Picture that the page holds itself, with words for who cannot see it."""
    source = base64.b64encode(image).decode("ascii")
    return (
        f'<figure><img loading="lazy" alt="{escape(about)}" src="data:image/png;base64,{source}">'
        "</figure>"
    )


def number(value: float) -> str:
    """Write a number in a table; a dash where there is none."""
    if not np.isfinite(value):
        return "–"
    if abs(value) < 1e-9:
        return "0"
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
