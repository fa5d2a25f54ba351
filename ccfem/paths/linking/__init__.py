"""From strands to printable paths: trimming, links between strands, and print order."""
