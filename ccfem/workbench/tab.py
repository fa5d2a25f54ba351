"""What the tabs of the page share, its fields and its lists; and the tab for the part file."""

from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from ccfem.base.errors import InputError, SolveError
from ccfem.cases.inspection import Check
from ccfem.cases.part_editing import Change
from ccfem.cases.reading import named_cases
from ccfem.workbench.bench import Bench, Said
from ccfem.workbench.guard import Served, escaped, send_again

PART, STRESS, MOVED, FIBRE, PRINT = VIEWS = ("Part", "Stress", "Deformed", "Fibre", "Print")
"""What the page shows in space: the part to be set up, or what the last run says of it."""


class Tabbed:
    """The page, as its tabs see it: it does one thing after the other, and says what goes wrong.

    Attributes
    ----------
    bench : Bench
    server : viser.ViserServer
    view, message : handles of viser
        Which of `VIEWS` is shown, and a line at the top.
    show, paint : callable
        Show what the part file says, and colour the faces by what acts on them.
    open, show_view : callable
        Open a part; show it, or what the last run says of it, by one of `VIEWS`.
    chosen : list of int
        Numbers of the faces that are chosen.
    checked : Check, optional
        What the newest check knows of the part.
    said : tuple of (str, str)
        What it says: kind and line of each.
    fields : list of Field
    """

    server: Any
    view: Any
    message: Any
    show: Callable[[], None]
    paint: Callable[[], None]
    open: Callable[[str], None]
    show_view: Callable[[str], None]

    def __init__(self, bench: Bench) -> None:
        self.bench, self.chosen = bench, list[int]()
        self.checked: Check | None = None
        self.said = Said()
        self.fields: list[Field] = []
        self._acts = ThreadPoolExecutor(1, "page")

    def act(self, what: Callable[..., None], *arguments: Any) -> "Future[None]":
        """Do something when all before it is done; what goes wrong is said on the page."""
        try:
            return self._acts.submit(self._safely, what, *arguments)
        except RuntimeError:  # the page is closed, or the program ends
            ended: Future[None] = Future()
            ended.cancel()
            return ended

    def _safely(self, what: Callable[..., None], *arguments: Any) -> None:
        try:
            with self.server.atomic():
                what(*arguments)
        except (InputError, SolveError, OSError) as error:
            self.say(str(error))
        except Exception as error:  # one act's fault ends no other
            self.say(f"{type(error).__name__}: {error}")

    def on(
        self, what: Callable[..., None], *arguments: Any, value: bool = False
    ) -> Callable[[Any], Any]:
        """Return a callback of viser that does something, with `value` to what came of a click.

        It is not called for values that are set here.
        """

        async def heed(event: Any) -> None:
            if event.client_id is not None:
                self.act(what, *arguments, *([event.target.value] if value else []))

        return heed

    def say(self, text: str) -> None:
        """Show a line at the top; an empty one takes it away."""
        self.message.content = f'<p class="ccfem message" role="alert">{escaped(text)}</p>'
        self.message.visible = bool(text)

    def edit(self, change: Change | str, field: str = "") -> None:
        """Change the part file, and show it."""
        self.bench.edit(change, field)
        self.say("")
        self.show()


_DIGITS = 6
"""Decimal places of numbers: as few as their step has would make 70.5 that is typed 705."""

_CROSSING = 5.0
"""Seconds after which a browser shows what was sent to it, however busy it is."""


class Field:
    """A field of the panel, whose value keeps the order of what is done.

    What is typed is acted on later, one thing after the other. What is shown here meanwhile never
    takes its place.

    Parameters
    ----------
    handle : handle of viser
    changed : callable, optional
        Takes each value that is typed. Where it raises, the field shows what it showed before.

    Attributes
    ----------
    value
        What the field held when what is being done now was asked for.
    typed : bool
        Whether somebody typed that value.
    """

    def __init__(
        self, page: Tabbed, handle: Any, changed: Callable[[Any], object] | None = None
    ) -> None:
        self.page, self.handle, self._changed = page, handle, changed
        self.value = self._shown = self._before = handle.value
        self.typed = self._doubtful = False
        self._came = self._taken = 0
        self._sent = handle.update_timestamp
        if isinstance(self.value, float | tuple):
            handle.precision = _DIGITS
        handle.on_update(self._heed)
        page.fields.append(self)

    async def _heed(self, event: Any) -> None:
        if event.client_id is not None:
            self._came += 1
            self._doubtful |= event.target.update_timestamp - self._sent < _CROSSING
            self.page.act(self._take, event.target.value, self.page.bench.opened)

    def _take(self, value: Any, opened: object) -> None:
        self._taken += 1
        if opened is not self.page.bench.opened:  # it was typed for the part before
            self.put(self._shown)
            return
        self.value, self.typed = self._joined(value), True
        try:
            if self._changed is not None:
                self._changed(self.value)
        except Exception:
            self.put(self._shown)
            raise
        self._show()

    def _joined(self, value: Any) -> Any:
        """Join a component that was typed with the others as they were put here meanwhile.

        Somebody types one component at a time. Where more of them differ he did not see yet what
        was put here last.
        """
        if not isinstance(value, tuple):
            return value
        if sum(new != now for new, now in zip(value, self.value, strict=True)) < 2:
            return value
        three = zip(value, self._before, self.value, strict=True)
        return tuple(now if new == old else new for new, old, now in three)

    def _show(self) -> None:
        if self._came == self._taken and self.handle.value != self.value:
            self.handle.value = self.value
            self._sent = self.handle.update_timestamp

    def put(self, value: Any) -> None:
        """Show a value, unless a newer one was typed that is still to be acted on."""
        if value != self.value:
            self._before, self.value = self.value, value
        self._shown = value
        self._show()

    def propose(self, value: Any) -> None:
        """Show a value where nobody has typed one."""
        if not self.typed:
            self.put(value)

    def settle(self) -> None:
        """Send the value again, when all is quiet, where it may have crossed with what was typed.

        Then the browser shows what was put here, and the part file has what was typed.
        """
        if self._doubtful and self._came == self._taken:
            self._doubtful, self._sent = False, self.handle.update_timestamp
            send_again(self.handle)


class Choice:
    """A list from which one thing is chosen and done; then it shows its first line again.

    Parameters
    ----------
    first : str
        That line.
    act : callable
        Takes the name of what is chosen.
    """

    def __init__(
        self, page: Tabbed, label: str, first: str, act: Callable[[str], object], hint: str = ""
    ) -> None:
        self._first, self._act = first, act
        self._handle = page.server.gui.add_dropdown(label, (first,), hint=hint or None)
        self._handle.on_update(page.on(self._chosen, value=True))

    def _chosen(self, name: str) -> None:
        if name != self._first:
            self._handle.value = self._first
            self._act(name)

    def offer(self, names: Iterable[str]) -> None:
        """Offer these names."""
        options = (self._first, *names)
        if self._handle.options != options:
            self._handle.options = options


def lines_of(said: Said) -> str:
    """HTML of what a check says, the worst first."""
    items = "".join(
        f'<li class="{kind.replace(" ", "-")}">'
        + (f"<b>{kind}</b> " if kind != "known" else "")
        + f"{escaped(line)}</li>"
        for kind, line in said
    )
    return f"<ul>{items}</ul>" if items else ""


class FileTab:
    """Text of the part file, and what can be opened in its place."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        with gui.add_folder("Open"):
            self.files = Choice(page, "In this folder", "choose", page.open)
            cases = Choice(page, "Cases of ccfem", "choose", page.open)
            cases.offer(sorted(named_cases()))
            upload = gui.add_upload_button(
                "Upload a body or a part file", hint="STEP, STL, mesh or TOML, up to 200 MB."
            )
            upload.on_upload(page.on(self._upload, value=True))
        self._said = gui.add_html("")

    def _upload(self, file: Any) -> None:
        self.page.open(self.page.bench.upload(file.name, file.content))

    def served(self) -> Served | None:
        """Serve the part file, to be saved."""
        bench = self.page.bench
        if bench.opened is None:
            return None
        return Served(bench.text.encode(), "application/toml", f"{bench.name}.toml")

    def show(self) -> None:
        """Show the part file."""
        bench = self.page.bench
        self.files.offer(bench.offered())
        if bench.opened is None:
            self._said.content = ""
            return
        command = f"ccfem check {bench.part_argument()}"
        self._said.content = (
            f'<div class="ccfem"><p><a href="/files/part.toml" download>Download the part file</a>'
            f"</p><p>In a terminal: <code>{escaped(command)}</code></p>"
            f'<pre tabindex="0">{escaped(bench.text)}</pre></div>'
        )
