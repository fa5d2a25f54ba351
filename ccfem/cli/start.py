"""Where ``ccfem`` starts: it can be stopped in one line while its libraries are being imported."""

import gc

from ccfem.cli import stopping

_OBJECTS = 100_000
"""New objects after which Python looks for those that only refer to each other. At its own 700 that
takes a twentieth of the time to compile, where nearly all objects stay."""


def start() -> None:
    """Run the command line."""
    stopping.end_at_once()
    gc.set_threshold(_OBJECTS, 20, 20)
    from ccfem.cli.main import main

    stopping.unwind()
    try:
        main()
    finally:
        stopping.end_at_once()
