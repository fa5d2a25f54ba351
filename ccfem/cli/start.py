"""Where ``ccfem`` starts: it can be stopped in one line while its libraries are being imported."""

from ccfem.cli import stopping


def start() -> None:
    """Run the command line."""
    stopping.end_at_once()
    from ccfem.cli.main import main

    stopping.unwind()
    try:
        main()
    finally:
        stopping.end_at_once()
