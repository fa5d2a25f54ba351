"""Running the command line, and how it ends: a line and an exit code, whatever went wrong."""

import io
import os
import signal
import sys
import warnings
from typing import Any

import typer

from ccfem.base.errors import InputError, SolveError
from ccfem.cli.commands import app
from ccfem.cli.run import complain
from ccfem.cli.stopping import Stopped, asked, say


def main() -> None:
    """Run the command line; bad input and failed solves end in one line and exit code 2."""
    # The base class of a wrong option or argument, wherever typer keeps it.
    usage_error: Any = typer.BadParameter.__mro__[1]
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a title outside ASCII on an ASCII terminal
            stream.reconfigure(errors="replace")
    warnings.formatwarning = _line
    # A title in letters that the font of pictures lacks is drawn as boxes; no more to say.
    warnings.filterwarnings("ignore", message="Glyph .* missing from")
    try:
        code = typer.main.get_command(app)(standalone_mode=False)
        if asked() is not None:  # a library took the stop for itself
            code = _complain("")
    except InputError as error:
        # All mistakes where they are asked for; elsewhere the first, and how many there are.
        code = _complain(*(error.mistakes if sys.argv[1:2] == ["check"] else (str(error),)))
    except SolveError as error:
        code = _complain(str(error))
    except usage_error as error:
        code = _complain(error.format_message())
    except (typer.Abort, KeyboardInterrupt, Stopped):
        code = say(asked() or signal.SIGINT)
    except BrokenPipeError:  # as under `ccfem cases | head -1`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 141
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        code = _complain(
            f"cannot continue{where}: {error.strerror or error}: correct this and repeat"
        )
    except BaseException:
        if asked() is None:
            raise
        code = _complain("")  # a library made something else of the stop
    sys.exit(code if isinstance(code, int) else 0)


def _line(message: Warning | str, *where: Any, **more: Any) -> str:
    """Warning as a line of its own: where in the code it arose says nothing to the user."""
    return f"ccfem: warning: {' '.join(str(message).split())}\n"


def _complain(*messages: str) -> int:
    """Print messages, or why all ends where that was asked for; returns the exit code."""
    number = asked()
    return complain(*messages) if number is None else say(number)
