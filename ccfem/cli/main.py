"""Running the command line, and how it ends: a line and an exit code, whatever went wrong."""

import io
import os
import signal
import sys
import warnings
from typing import Any

import typer

from ccfem.cli.commands import app
from ccfem.errors import InputError, SolveError

__all__ = ["main"]


def main() -> None:
    """Run the command line; bad input and failed solves end in one line and exit code 2."""
    # The base class of a wrong option or argument, wherever typer keeps it.
    usage_error: Any = typer.BadParameter.__mro__[1]
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a title outside ASCII on an ASCII terminal
            stream.reconfigure(errors="replace")
    # A title in letters that the font of pictures lacks is drawn as boxes; no more to say.
    warnings.filterwarnings("ignore", message="Glyph .* missing from")
    try:
        code = typer.main.get_command(app)(standalone_mode=False)
    except InputError as error:
        # All mistakes where they are asked for; elsewhere the first, and how many there are.
        code = _complain(*(error.mistakes if sys.argv[1:2] == ["check"] else (str(error),)))
    except SolveError as error:
        code = _complain(str(error))
    except usage_error as error:
        code = _complain(error.format_message())
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:  # as under `ccfem cases | head -1`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 141
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        code = _complain(
            f"cannot continue{where}: {error.strerror or error}: correct this and repeat"
        )
    sys.exit(code if isinstance(code, int) else 0)


def _complain(*messages: str) -> int:
    for message in messages:
        print("ccfem: error:", " ".join(message.split()), file=sys.stderr)
    return 2
