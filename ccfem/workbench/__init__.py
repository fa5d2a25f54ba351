"""The workbench: a part set up, planned and taken away by clicks, in a browser.

A thin skin: what is on the screen is a part file (`part_edits`), and each action calls the function
that the command line calls.
"""

from ccfem.workbench.opening import open

__all__ = ["open"]
