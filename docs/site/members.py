"""Pages of the families: strategies and slicers with their parameters."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from keys import keys

from ccfem import strategies
from ccfem.cli.docstring import about
from ccfem.slicing import slicers as slicing

__all__ = ["slicers_page", "strategies_page"]

_STRATEGIES = """# Strategies

A strategy turns the stress on a layer into fibre paths. On the command line a parameter is set by
`--set NAME.PARAMETER=VALUE`, in a part file under `[strategies.NAME]`, in Python as an argument:
`ccfem.strategies.Isocurve(power=0.5)`. What sets the amount of fibre is what a comparison at equal
length turns.

"""

_SLICERS = """# Slicers

A slicer cuts a part into layers, flat or curved. On the command line it is given as
`--slicing NAME:PARAMETER=VALUE,...`, in a part file as `[slicing] method = "NAME"`, in Python as a
value of `ccfem.slicing.slicers`.

"""


def strategies_page() -> str:
    """Write a section for each strategy."""
    return _STRATEGIES + _sections(strategies.named())


def slicers_page() -> str:
    """Write a section for each slicer."""
    return _SLICERS + _sections(slicing.named())


def _sections(members: Mapping[str, Any]) -> str:
    return "".join(_section(name, each) for name, each in sorted(members.items()))


def _section(name: str, member: Any) -> str:
    text = "\n\n".join(about(member))
    amount = getattr(member, "amount", None)
    if amount is not None:
        text += (
            f"\n\nThe amount of fibre is set by `{amount.parameter}`: {amount.most:g} lays most, "
            f"{amount.least:g} least."
        )
    return f"## {name}\n\n{text}\n\n{keys(member) if dataclasses.fields(member) else ''}"
