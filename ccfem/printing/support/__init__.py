"""Support: what has to stand below a part that is printed, how much of it, and its layers."""

from ccfem.printing.support.column_mesh import ColumnMesh, column_mesh, propped_space
from ccfem.printing.support.columns import SupportColumns, support_columns
from ccfem.printing.support.support_field import SupportField, support_field
from ccfem.printing.support.support_layers import SupportLayers, slice_with_support, support_layers
from ccfem.printing.support.support_paths import support_paths

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
