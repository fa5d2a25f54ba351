"""A browser for tests of pages: where it is, and how it is started."""

import os
import shutil

import pytest

OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
NAMELESS = """[...document.querySelectorAll('select, input, button')].filter(
    (each) => !['hidden', 'file'].includes(each.type)).filter(
    (each) => !each.labels?.length && !each.getAttribute('aria-label') && !each.textContent.trim()
      || each.tagName === 'SELECT' && !each.labels?.length && !each.getAttribute('aria-label')
).length"""
"""Counts what has no name for who cannot see it."""


def started(program):
    """Start the Chromium of this machine; skip where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = [os.environ.get("CCFEM_CHROMIUM", ""), *(shutil.which(name) or "" for name in names)]
    path = next((path for path in found if path), "")
    if not path:
        pytest.skip("there is no browser: install chromium, or name one by CCFEM_CHROMIUM")
    return program.chromium.launch(executable_path=path, args=OPTIONS)
