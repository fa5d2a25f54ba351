"""Fibre that winds round the joints of a layer: what the strategy `winding` stands on."""
