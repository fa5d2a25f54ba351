"""How long work tells its caller where it stands."""

from collections.abc import Callable

__all__ = ["Progress", "silent"]

Progress = Callable[[str, float], None]
"""Called with what is being done now and the share, in [0, 1], of all work that is done."""


def silent(what: str, share: float) -> None:
    """Tell nobody."""
