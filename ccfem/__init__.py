"""ccfem: finite elements and stress-driven toolpaths for printing continuous fibre.

Units are mm, N and MPa everywhere, angles in degrees at the interface.

The line of flow, each arrow one function or one small callable value::

    TetMesh -> Problem -> StressField -> Layers -> Strategy -> Toolpaths -> Evaluation
"""

__version__ = "0.1.0"
