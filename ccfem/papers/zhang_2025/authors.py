"""The authors' strands on the T-bracket, and where they lie on the layers rebuilt from them.

The data set has the strands of this part as lines, without its layers. The part is that of Fang et
al. 2024, whose solid is recovered from their own layers.
"""

import os
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.path_table import read_strands
from ccfem.slicing.layers.layer import Layer

DATA = "CCFEM_ZHANG2025"
"""Environment variable that names the folder of the published data."""
BUILD = (0.0, 1.0, 0.0)


def authors_folder() -> Path:
    """Folder of the strands of the T-bracket."""
    named = os.environ.get(DATA)
    if not named:
        raise InputError(f"set {DATA} to the folder of the data of Zhang et al. 2025")
    return Path(named) / "T-bracket" / "StripPath"


def authors_strands(folder: Path) -> Toolpaths:
    """Read the strands, numbered by the layers of their files."""
    return read_strands(folder, np.eye(3), np.array(BUILD))


def strands_on(layers: tuple[Layer, ...], strands: Toolpaths) -> Toolpaths:
    """Move strands onto the layers that were laid through them."""
    numbers = np.unique(strands.layer).tolist()
    return Toolpaths.concatenate(
        [
            GivenPaths(strands.on_layer(number), "the authors' strands").on([layer]).toolpaths
            for number, layer in zip(numbers, layers, strict=True)
        ]
    )
