"""Pages that are made of the code: what MkDocs calls while it builds the site."""

from collections.abc import Callable
from typing import Any

from cases import cases_page
from commands import commands_page
from indices import indices_page
from members import slicers_page, strategies_page
from mkdocs.structure.files import File, Files
from part_file import part_file_page
from python import python_page

PAGES: dict[str, Callable[[], str]] = {
    "cases.md": cases_page,
    "reference/part_file.md": part_file_page,
    "reference/commands.md": commands_page,
    "reference/strategies.md": strategies_page,
    "reference/slicers.md": slicers_page,
    "reference/indices.md": indices_page,
    "reference/python.md": python_page,
}


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    for uri, make in PAGES.items():
        files.append(File.generated(config, uri, content=make()))
    return files
