"""Colours of pictures: one per strategy, told apart by colour-blind readers too, and scales.

The strategies take the colours of M. Okabe and K. Ito, Color Universal Design (2008). Scales run
in one hue from light to dark.
"""

from collections.abc import Iterable
from typing import Any

INK = "#1d2430"
"""Text, and fibre over a stress map."""
LINK = "#4a8fd4"
"""Fibre that only joins strands."""
OUTLINE = "#5d6878"
"""Border of a section."""
SECTION = "#ececea"
"""Section without a stress map."""

_STRATEGIES = {
    "isocurve": "#0072b2",
    "concentric": "#e69f00",
    "zigzag": "#009e73",
    "contour_zigzag": "#cc79a7",
}
_OTHERS = (
    *("#d55e00", "#56b4e9", "#8c7a00", "#4d4d4d"),
    *("#7b4fa6", "#9c2f2f", "#7ac36a", "#1f4e5f", "#b08968", "#ef8fb4"),
)

_SCALES = {
    "stress": (SECTION, "#f9e9cc", "#fbd9a5", "#f5b36b", "#e58646"),
    "size": ("#a9bdd6", "#7ba1cf", "#4f83bd", "#265a94", "#0d2f5c"),
    "field": ("#eef3f0", "#b9dccb", "#7cc0a6", "#41937f", "#1c5f58"),
}


def palette(names: Iterable[str]) -> dict[str, str]:
    """Colour of each strategy, "#rrggbb"; the known ones always have the same.

    Parameters
    ----------
    names : iterable of str
        Strategies in one picture. Unknown ones take the free colours in their order, which repeat
        after ten.
    """
    colours: dict[str, str] = {}
    others = 0
    for name in names:
        if name not in colours:
            known = _STRATEGIES.get(name)
            colours[name] = known or _OTHERS[others % len(_OTHERS)]
            others += known is None
    return colours


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour "#rrggbb"."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


def gradient(name: str) -> str:
    """Return a scale from left to right, as CSS."""
    return f"linear-gradient(90deg, {', '.join(_SCALES[name])})"


def scale(name: str) -> Any:
    """Colour map of matplotlib.

    Parameters
    ----------
    name : {"stress", "field", "size"}
        For a map of tension, or of another field, that fibre is drawn on; for a quantity on the
        fibre, from none to much.
    """
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(name, _SCALES[name])
