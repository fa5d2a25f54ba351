import io

import pytest
from rich.console import Console
from rich.table import Table

from ccfem.cli import screen

NAMES = ("isocurve", "contour_zigzag", "concentric", "stream_function", "mean_tension_of_regions")
TITLES = ("stiffness over the unreinforced part", "first failure, N")


def table_of(names):
    table = Table()
    table.add_column("", min_width=screen._longest_word(TITLES))
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
    for title in TITLES:
        table.add_row(title, *(f"{k}.25 (1.5)" for k in range(len(names))))
    return table


@pytest.mark.parametrize("width", [40, 60, 80, 120, 200])
def test_no_width_breaks_a_name_or_leaves_one_out(width):
    console = Console(width=width, file=io.StringIO(), color_system=None)
    screen._print_in_columns(console, NAMES, table_of)
    text = console.file.getvalue()
    words = text.split()
    for name in NAMES if width > 40 else NAMES[:4]:
        assert words.count(name) == 1
    assert "unreinforced" in words
    if width == 200:  # all fit side by side: one table
        assert words.count("unreinforced") == 1
    assert max(map(len, text.splitlines())) <= width


@pytest.mark.parametrize("width", [40, 60, 80, 150])
def test_parameters_of_a_strategy_are_read_on_every_screen(monkeypatch, capsys, width):
    monkeypatch.setenv("COLUMNS", str(width))
    screen.print_member("strategy", "stream_function")
    words = capsys.readouterr().out.split()
    for name in ("spacing", "smoothness", "minimum_radius", "length"):
        if name in screen._members("strategy")["stream_function"].__dataclass_fields__:
            assert name in words
    assert not any(word.endswith("\N{HORIZONTAL ELLIPSIS}") for word in words)
