"""A part file: a strip that is held at one end and pulled at the other."""

PART = """
title = "Strip, 60 mm"
material = "pla"
[planform]
outline = [[0, 0], [60, 0], [60, 20], [0, 20]]
height = 5
edge_length = 5
[patches.foot]
rule = "plane"
normal = "x"
offset = "min"
[patches.end]
rule = "plane"
normal = "x"
offset = "max"
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "end"
vector = [100, 0, 0]
"""
