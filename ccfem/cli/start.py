"""Where ``ccfem`` starts: quiet already when it is stopped while its libraries are being read."""

import os
import signal
from types import FrameType

__all__ = ["start"]


def start() -> None:
    """Run the command line; Ctrl-C before it is there ends without a word, with code 130."""
    heeded = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN  # as behind nohup
    signal.signal(signal.SIGTERM, _end)
    if heeded:
        signal.signal(signal.SIGINT, _end)
    from ccfem.cli.commands import main

    if heeded:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    main()


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(130)
