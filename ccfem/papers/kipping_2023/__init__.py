"""Kipping and Schueppstuhl 2023: layers square to the least stress; ours beside theirs."""
