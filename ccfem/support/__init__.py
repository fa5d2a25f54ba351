"""Support: what has to stand below a part that is printed, how much of it, and where it touches."""

from ccfem.support.columns import SupportColumns, support_columns

__all__ = ["SupportColumns", "support_columns"]
