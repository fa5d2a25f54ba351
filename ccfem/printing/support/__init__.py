"""Support: what has to stand below a part that is printed, how much of it, and its layers."""

from ccfem.printing.support.matched_layers import (
    SupportField,
    SupportLayers,
    slice_with_support,
    support_field,
    support_layers,
    support_paths,
)
from ccfem.printing.support.meshed_columns import (
    ColumnMesh,
    SupportColumns,
    column_mesh,
    propped_space,
    support_columns,
)

__all__ = [
    "ColumnMesh",
    "SupportColumns",
    "SupportField",
    "SupportLayers",
    "column_mesh",
    "propped_space",
    "slice_with_support",
    "support_columns",
    "support_field",
    "support_layers",
    "support_paths",
]
