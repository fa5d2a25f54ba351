"""The tab for the part file: its text, to be taken away, and other files to be opened."""

from typing import Any

from ccfem.cases.reading import named_cases
from ccfem.workbench.guard import Served, escaped
from ccfem.workbench.tab import Tabbed

_NOTHING = "choose"


class FileTab:
    """Text of the part file, and what can be opened in its place."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        with gui.add_folder("Open"):
            files, cases = page.bench.offered(), sorted(named_cases())
            self.files = gui.add_dropdown("In this folder", (_NOTHING, *files))
            self.cases = gui.add_dropdown("Cases of ccfem", (_NOTHING, *cases))
            for choice in (self.files, self.cases):
                choice.on_update(page.on(self._open, choice, value=True))
            upload = gui.add_upload_button(
                "Upload a body or a part file", hint="STEP, STL, mesh or TOML, up to 200 MB."
            )
            upload.on_upload(page.on(self._upload, value=True))
        self._said = gui.add_html("")

    def _open(self, choice: Any, name: str) -> None:
        if name != _NOTHING:
            choice.value = _NOTHING
            self.page.open(name)

    def _upload(self, file: Any) -> None:
        self.page.open(self.page.bench.upload(file.name, file.content))

    def served(self) -> Served | None:
        """Serve the part file, to be saved."""
        bench = self.page.bench
        if bench.opened is None:
            return None
        name = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in bench.name)
        return Served(bench.text.encode(), "application/toml", f"{name}.toml")

    def show(self) -> None:
        """Show the part file."""
        bench = self.page.bench
        offered = (_NOTHING, *bench.offered())
        if self.files.options != offered:
            self.files.options = offered
        if bench.opened is None:
            self._said.content = ""
            return
        command = f"ccfem check {bench.part_argument()}"
        self._said.content = (
            f'<div class="ccfem"><p><a href="/files/part.toml" download>Download the part file</a>'
            f"</p><p>In a terminal: <code>{escaped(command)}</code></p>"
            f'<pre tabindex="0">{escaped(bench.text)}</pre></div>'
        )
