"""Stress vector tracing: members of a section, main load paths through its joints, their tracks.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181.
"""
