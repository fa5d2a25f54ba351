"""The tab for the part file: its text, to be taken away, and other files to be opened."""

from typing import Any

from ccfem.cases.reading import named_cases
from ccfem.workbench.guard import Served, escaped
from ccfem.workbench.tab import Choice, Tabbed


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
