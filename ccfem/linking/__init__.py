"""From strands to printable paths: their order, what joins them, and where they are trimmed."""
