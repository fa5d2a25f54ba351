"""Figures of sections: size, scale bar, colour bar, and files. Pyplot's state is left alone."""

import io
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.whole import check_writable, whole_file
from ccfem.comparison.plot.colours import INK, OUTLINE

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEAD, _FOOT = 0.50, 0.34
"""Space for title and scale bar, inches."""
_WIDTH = 4.0
"""Width of one picture, inches."""
_MARGIN = 0.03
"""Free space round the section over its larger extent."""
_DPI = 150.0
_COLOURS = 128
_FORMATS = (".png", ".pdf", ".svg")
_FONT: dict[str, Any] = {"family": ["DejaVu Sans"], "color": INK}


def canvas(width: float, height: float, **options: Any) -> "Figure":
    """Make an empty white figure, inches, that draws without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white", **options)
    FigureCanvasAgg(figure)
    return figure


def new_figure(
    extents: Sequence[float], columns: int = 1, rows: int = 1
) -> tuple["Figure", list["Axes"]]:
    """Figure with one picture of a section, or several side by side and below each other.

    Parameters
    ----------
    extents : 4 floats, mm
        x and y of the lower left, then of the upper right corner of what is drawn.
    columns, rows : int, default 1
        Pictures; the height of each follows the section's shape, up to one and a half times its
        width. Their axes have no frame and no ticks, and are in mm, both to one scale. They come
        row by row from the upper left.
    """
    left, bottom, right, top = extents
    margin = _MARGIN * max(right - left, top - bottom)
    wide, high = right - left + 2.0 * margin, top - bottom + 2.0 * margin
    height = _WIDTH * min(max(high / wide, 0.2), 1.5)
    total = height + _HEAD + _FOOT
    figure = canvas(columns * _WIDTH, rows * total, dpi=_DPI)
    axes = []
    for k in range(columns * rows):
        row, column = divmod(k, columns)
        bottom_edge = ((rows - 1 - row) * total + _FOOT) / (rows * total)
        one = figure.add_axes(
            (column / columns, bottom_edge, 1.0 / columns, height / (rows * total))
        )
        one.set_axis_off()
        one.set_xlim(left - margin, right + margin)
        one.set_ylim(bottom - margin, top + margin)
        one.set_aspect("equal")
        axes.append(one)
    return figure, axes


def title(
    axes: "Axes", heading: str, caption: str = "", colour: str | None = None
) -> list["Artist"]:
    """Write a heading and one line of key numbers above a picture; returns what was drawn.

    With a colour, that of the strategy, there is a mark of it before the heading.
    """
    drawn: list[Artist] = []
    figure = _figure(axes)
    box, wide, high = axes.get_position(), figure.get_figwidth(), figure.get_figheight()
    x = start = box.x0 + 0.12 / wide
    if colour is not None:
        from matplotlib.patches import Rectangle

        place, size = (x, box.y1 + 0.275 / high), (0.10 / wide, 0.13 / high)
        mark = Rectangle(place, *size, color=colour, transform=figure.transFigure)
        drawn.append(figure.add_artist(mark))
        x += 0.17 / wide
    drawn.append(figure.text(x, box.y1 + 0.27 / high, heading, size=10, weight="bold", **_FONT))
    drawn.append(figure.text(start, box.y1 + 0.08 / high, caption, size=7.5, **_FONT))
    return drawn


def _figure(axes: "Axes") -> Any:
    return axes.figure


def scale_bar(axes: "Axes") -> None:
    """Draw a bar of a round length below a picture."""
    figure = _figure(axes)
    box = axes.get_position()
    left, right = axes.get_xlim()
    per_mm = inches_per_mm(axes) / figure.get_figwidth()
    length = _round_length(0.25 * (right - left))
    x = box.x0 + 0.12 / figure.get_figwidth()
    y = box.y0 - 0.12 / figure.get_figheight()
    from matplotlib.lines import Line2D

    figure.add_artist(
        Line2D([x, x + length * per_mm], [y, y], color=INK, lw=1.6, solid_capstyle="butt")
    )
    place = x + length * per_mm + 0.05 / figure.get_figwidth()
    figure.text(place, y, f"{length:g} mm", size=7.5, va="center", **_FONT)


def inches_per_mm(axes: "Axes") -> float:
    """Scale of a picture: the axes may be larger than the picture, which keeps its shape."""
    box = axes.get_position()
    size = _figure(axes).get_size_inches() * [box.width, box.height]
    left, right = axes.get_xlim()
    bottom, top = axes.get_ylim()
    return float(min(size[0] / (right - left), size[1] / (top - bottom)))


def _round_length(most: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is at most `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))


def colour_bar(axes: "Axes", colours: Any, limits: tuple[float, float], label: str) -> None:
    """Draw the scale of a colour map below a picture, at its right.

    `limits` are the values at its ends, `label` is quantity and unit.
    """
    figure = _figure(axes)
    box = axes.get_position()
    wide, high = figure.get_figwidth(), figure.get_figheight()
    y = box.y0 - 0.12 / high
    right = box.x1 - 0.12 / wide
    upper = figure.text(
        right, y, f"{limits[1]:.3g} {label}", size=7.5, ha="right", va="center", **_FONT
    )
    extent = upper.get_window_extent(figure.canvas.get_renderer())
    end = right - 1.03 * extent.width / figure.dpi / wide - 0.08 / wide
    bar = figure.add_axes((end - 0.6 / wide, y - 0.05 / high, 0.6 / wide, 0.1 / high))
    bar.imshow(np.linspace(0.0, 1.0, 64)[None], aspect="auto", cmap=colours)
    bar.set_xticks([])
    bar.set_yticks([])
    for side in bar.spines.values():
        side.set(color=OUTLINE, linewidth=0.5)
    start = end - 0.68 / wide
    figure.text(start, y, f"{limits[0]:.3g}", size=7.5, ha="right", va="center", **_FONT)


def png(figure: "Figure", dpi: float = _DPI) -> bytes:
    """Return a figure as the bytes of a PNG file.

    The colours are reduced to 128, which makes reports with many pictures several times smaller.
    """
    figure.set_dpi(dpi)
    figure.canvas.draw()
    return _encoded(figure)


def png_series(figure: "Figure", pictures: Iterable[Sequence["Artist"]]) -> list[bytes]:
    """Return PNG files of a figure with other artists on top each time; it is drawn once."""
    canvas: Any = figure.canvas
    figure.set_dpi(_DPI)
    above = [list(artists) for artists in pictures]
    for artist in chain.from_iterable(above):
        artist.set_animated(True)  # left out where the whole figure is drawn
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)
    files = []
    for artists in above:
        canvas.restore_region(background)
        for artist in artists:
            artist.draw(canvas.get_renderer())
        files.append(_encoded(figure))
    return files


def _encoded(figure: "Figure") -> bytes:
    """Bytes of a PNG file with what a figure's canvas shows."""
    from PIL import Image

    dpi = figure.dpi
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])  # type: ignore[attr-defined]
    reduced = image.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    background: Any = reduced.getpixel((0, 0))
    colours: Any = reduced.getpalette()
    colours[3 * background : 3 * background + 3] = [255, 255, 255]
    reduced.putpalette(colours)
    target = io.BytesIO()
    reduced.save(target, "png", dpi=(dpi, dpi))
    return target.getvalue()


def save(figure: "Figure", path: str | Path, dpi: float = _DPI) -> None:
    """Write a figure to a file, whole or not at all; the suffix (.png, .pdf, .svg) says the format.

    Raises
    ------
    InputError
        When the file cannot be written, or the format is another one.
    """
    path = check_picture(path)
    if path.suffix.lower() == ".png":
        content = png(figure, dpi)
    else:  # to memory: on a full disk the writer of PDF raises errors of zlib
        target = io.BytesIO()
        figure.savefig(target, format=path.suffix[1:].lower(), dpi=dpi)
        content = target.getvalue()
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def check_picture(path: str | Path) -> Path:
    """Return `path` when a picture of that name can be written: to be asked before any work."""
    path = Path(path)
    if path.suffix.lower() not in _FORMATS:
        raise InputError(
            f"a picture is written as {', '.join(_FORMATS)}; got '{path.name}': change its suffix"
        )
    return check_writable(path)


def extents_of(points: FloatArray) -> tuple[float, float, float, float]:
    """Extents (left, bottom, right, top) of points (n, 2), mm."""
    return (*points.min(axis=0).tolist(), *points.max(axis=0).tolist())
