"""Planning on a bitmap of the section, one pixel a fibre wide, as in Plocher et al. (2022).

A pattern parts the solid pixels into regions, one a pixel wide; regions are traced into paths.
"""
