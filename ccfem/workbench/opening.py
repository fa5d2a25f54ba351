"""Opening the workbench: from a notebook, or until Ctrl-C from the command line."""

import atexit
import contextlib
import os
import signal
import threading
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from ccfem.base.errors import InputError
from ccfem.workbench.bench import Bench

if TYPE_CHECKING:
    from ccfem.workbench.page import Page


class Workbench:
    """A page that is being served; in a notebook it shows the link that opens it.

    Attributes
    ----------
    link : str
        Opens the page in a browser on this machine. Who has it may work with the page.
    """

    def __init__(self, page: "Page") -> None:
        self._page = page
        self.link = page.link
        atexit.register(self.close)

    def close(self) -> None:
        """Stop the run and the server; the end of the program does that, too."""
        atexit.unregister(self.close)
        self._page.close()

    def __repr__(self) -> str:
        return f"Workbench: {self.link}"

    def _repr_html_(self) -> str:
        return (
            f'<a href="{escape(self.link)}" target="_blank" rel="noopener">Open the workbench</a> '
            "in a tab of its own, on the machine where this notebook runs; .close() ends it"
        )


def open(
    what: str | os.PathLike[str] | None = None,
    folder: str | os.PathLike[str] = ".",
    port: int = 0,
) -> Workbench:
    """Open a body, a part file or a case in the workbench, a page in the browser.

    Parameters
    ----------
    what : path or str, optional
        A body (.step, .stl, a mesh), a part file (.toml), or the name of a case; by default one is
        chosen on the page.
    folder : path
        Only what lies in this folder is read, and only ``results/`` in it is written to.
    port : int
        Port on this machine; 0 for any that is free.

    Returns
    -------
    Workbench
        Shows the link to the page; `Workbench.close` ends it.

    Raises
    ------
    InputError
        Where viser is not installed, or `what` cannot be read.
    """
    try:
        import viser  # noqa: F401
    except ImportError:
        raise InputError(
            'the workbench needs viser, which is not installed: pip install "ccfem[ui]"'
        ) from None
    bench = Bench(Path(folder))
    if what is not None:
        bench.open(what)
    from ccfem.workbench.page import Page

    return Workbench(Page(bench, port))


def serve(what: str | None, port: int, browser: bool) -> None:
    """Open the workbench, print its link, and serve it until the program is stopped."""
    workbench = open(what, port=port)
    try:
        print(f"{workbench.link}\n(Ctrl-C ends it, and a run that is going on)", flush=True)
        if browser:
            _show(workbench.link)
        while True:
            threading.Event().wait(3600.0)
    finally:
        workbench.close()
        _end_children()


def _show(link: str) -> None:
    import webbrowser

    with contextlib.suppress(webbrowser.Error):
        webbrowser.open(link)


def _end_children() -> None:
    """End what a check has started, as a mesher: the processes of this one's group."""
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.killpg(os.getpid(), signal.SIGTERM)
