"""Papers whose figures and tables are made again: ``ccfem reproduce PAPER``."""
