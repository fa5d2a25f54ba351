"""The page itself: a template filled with texts, and the data and programs that it holds."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from ccfem.comparison.report.packing import compressed, pack


def filled_page(context: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    """Fill the template of the report.

    Parameters
    ----------
    context : mapping
        What the template names. All texts are escaped.
    data : mapping
        What the page draws: see `ccfem.comparison.report.packing.pack`.

    Returns
    -------
    str
        HTML that needs no other file and no network.
    """
    return _template().render(
        **context,
        style=_text("report.css"),
        script=_text("report.js"),
        data=pack(data),
        plotly=_plotly(),
    )


def _text(name: str) -> str:
    return files("ccfem.comparison.report").joinpath(name).read_text(encoding="utf-8")


@cache
def _template() -> Any:
    """Template with all texts escaped; a name that nothing is given for is an error."""
    from jinja2 import Environment, StrictUndefined

    surroundings = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return surroundings.from_string(_text("report.html.jinja"))


@cache
def _plotly() -> str:
    """Return the drawing library that the package plotly ships, compressed."""
    return compressed(files("plotly").joinpath("package_data", "plotly.min.js").read_bytes())
