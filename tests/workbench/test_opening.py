"""Opening the workbench from Python: the link it shows, and one line where viser is missing."""

import ast
import socket
import sys
import urllib.request
from functools import partial
from pathlib import Path

import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.workbench import opening


def test_without_viser_one_line_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError, match=r'not installed: pip install "ccfem\[ui\]"$'):
        ccfem.open(folder=tmp_path)


def test_a_notebook_shows_a_link_that_opens_the_page(tmp_path):
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    workbench = ccfem.open("bar", tmp_path)
    try:
        assert workbench.link in repr(workbench)
        assert f'href="{workbench.link}"' in workbench._repr_html_()
        with urllib.request.urlopen(workbench.link, timeout=10) as answer:
            assert answer.headers["Set-Cookie"].startswith("ccfem-")
        assert workbench._page.bench.part_argument() == "results/bar.toml"
    finally:
        workbench.close()
    port = int(workbench.link.partition("/?")[0].rpartition(":")[2])
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=5)


def test_nothing_is_open_at_first(tmp_path):
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    workbench = ccfem.open(folder=tmp_path)
    page = workbench._page
    try:
        compare = partial(page.compare._begin, page.compare._compare)
        for act in (compare, page.loads._load, lambda: page.show_view("Fibre")):
            page.act(act).result()
            assert "Error" not in page.message.content.replace("InputError", "")
        page.act(page.open, "nothing").result()
        assert "no case named" in page.message.content
        assert not (tmp_path / "results").exists()
        page.act(page.open, "bar").result()
        assert "Tensile bar" in page.heading.content
    finally:
        workbench.close()


def code_lines(text):
    """Lines of code: without blank ones, comments and docstrings."""
    words = [
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        for line in range(node.lineno, node.end_lineno + 1)
    ]
    lines = enumerate(text.splitlines(), 1)
    return sum(k not in words and line.strip()[:1] not in ("", "#") for k, line in lines)


def test_the_skin_is_thin():
    folder = Path(opening.__file__).parent
    assert code_lines('"""Words."""\n\n# more\nx = 1\ny = (\n    2)\n') == 3
    assert sum(code_lines(path.read_text("utf-8")) for path in folder.glob("*.py")) < 2000
    head = (folder / "head.html").read_text("utf-8")
    script = head.partition("<script>")[2].partition("</script>")[0]
    assert 10 < len(script.splitlines()) < 100
