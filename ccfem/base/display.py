"""How values show themselves in notebooks: in words here, in pictures by whoever draws them.

The core does not know the pictures. What draws is named once, by the package's face, and is
imported when the first value is asked to show itself.
"""

import importlib
import re
from typing import Any, Protocol, cast


class _Drawing(Protocol):
    """What draws values."""

    def figure(self, value: Any, **options: Any) -> Any: ...
    def page(self, value: Any) -> str: ...
    def show(self, value: Any, **options: Any) -> Any: ...


_module = ""


def drawn_by(module: str) -> None:
    """Name the module that draws: it has the functions ``figure``, ``page`` and ``show``."""
    global _module
    _module = module


def _drawing() -> _Drawing:
    return cast(_Drawing, importlib.import_module(_module))


class Shown:
    """A value that shows itself: a line of text, a page in notebooks, a picture, a view in 3D."""

    __slots__ = ()

    def plot(self, **options: Any) -> Any:
        """Draw the value in the plane, as a figure of matplotlib.

        Parameters
        ----------
        **options
            Of the function in `ccfem.comparison.plot.values` that draws such a value, as
            ``layer=3`` of paths.
        """
        return _drawing().figure(self, **options)

    def show(self, **options: Any) -> Any:
        """Show the value in space: in a window or a notebook, else as a picture.

        Parameters
        ----------
        picture : path, optional
            Write the view to a file (.png) instead.
        **options
            Of the function in `ccfem.comparison.plot.scenes` that draws such a value.

        Returns
        -------
        View or None
            The picture, where no window could be opened; a notebook shows it.
        """
        return _drawing().show(self, **options)

    def _repr_html_(self) -> str:
        return _drawing().page(self)


_RUNS_OF_DIGITS = re.compile(r"(\d+)")


def by_number(text: str) -> list[int | str]:
    """Key that sorts words with numbers as people do: layer_2 before layer_10."""
    parts = _RUNS_OF_DIGITS.split(text)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)]
