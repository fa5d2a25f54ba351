"""Planning on a bitmap of the section, one pixel a fibre wide, as in Plocher et al. (2022).

A pattern divides the solid pixels into regions a pixel wide; regions are traced into paths through
the centres of their pixels. Pixels lie along the two axes of the layer: a turned part gets other
paths. What no path passes through is reported as isolated pixels, which have to be filled by more
extrusion of the path beside them.
"""
