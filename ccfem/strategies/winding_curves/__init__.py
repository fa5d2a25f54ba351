"""Fibre that winds round the joints of a layer: the basis of the strategy `winding`."""
