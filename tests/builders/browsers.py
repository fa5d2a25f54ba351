"""A browser for tests of pages: where it is, and how it is started."""

import pytest

from benchmarks.clicking import browser_path, launched

NAMELESS = """[...document.querySelectorAll('select, input, button')].filter(
    (each) => !['hidden', 'file'].includes(each.type)).filter(
    (each) => !each.labels?.length && !each.getAttribute('aria-label') && !each.textContent.trim()
      || each.tagName === 'SELECT' && !each.labels?.length && !each.getAttribute('aria-label')
).length"""
"""Counts what has no name for who cannot see it."""


def started(program):
    """Start the Chromium of this machine; skip where there is none."""
    if not browser_path():
        pytest.skip("there is no browser: install chromium, or name one by CCFEM_CHROMIUM")
    return launched(program)
