# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # Layers that curve with the stress, fibre that winds round the bolts
#
# Fang et al. (arXiv:2311.17265) print with a robot: layers follow the
# strongest stress and are square to the bolts, and strands of fibre wind round all bolts of a
# layer. Here: a lifting eye, whose eye lies across the bolts of its flange, so that no flat layer
# holds all three. The T-bracket with the authors' own layers, all tables and the claims beside ours
# are `ccfem reproduce fang_2024`.

# %%
from dataclasses import replace

import numpy as np

from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.judging.evaluation import evaluate
from ccfem.slicing.slicers import Planar, Spatial
from ccfem.paths.planning import plan
from ccfem.strategies import create
from ccfem.judging.virtual_testing import virtual_test
from ccfem.strategies.winding_curves.piece import joint_loops

case = create_case("lifting_eye", order=1)
stress = solve(case.problem)["lift"]
names = stress.held_or_loaded
print(f"{len(stress.mesh.cells)} cells, joints {', '.join(names)}")

# %% [markdown]
# ## Layers
#
# One sparse solve gives a field whose level surfaces are the layers. Its quality: the angle of the
# stress to the layers where stress lines join the bolts, and the thickness, nominal 2.5 mm.

# %%
sliced = Spatial(thickness=2.5).slice(stress, case.build)
quality = sliced.quality
print(f"{len(sliced.layers)} layers, stress {quality.angle_mean:.1f} degrees off them")
print(f"thickness {quality.thickness_5:.2f} to {quality.thickness_95:.2f} mm")
assert quality.folded == 0.0


def holes_in(layers):
    """Largest number of joints that any layer has a hole at."""
    return max(len(joint_loops(layer, names)) for layer in layers)


flat = {axis: Planar(count=9, axis=axis).cut(stress.mesh, case.build) for axis in "xyz"}
print("joints in one layer: curved", holes_in(sliced.layers), end="")
print("".join(f", flat across {axis} {holes_in(each)}" for axis, each in flat.items()))
assert holes_in(sliced.layers) == 3
assert max(holes_in(each) for each in flat.values()) < 3

# %% [markdown]
# ## Strands
#
# Every strand is closed and winds once round all three joints.

# %%
paths = plan(create("winding"), sliced.layers, stress, case.machine)
total = evaluate(paths, sliced.layers, stress, case.machine, build=case.build).total
laid = len(np.unique(paths.layer))
print(f"{len(paths)} strands, {paths.lengths.sum() / 1e3:.1f} m on {laid} layers")
print(f"joints linked {total['joints_linked']:.2f}")
print(f"angle to the stress {total['space_angle_stress']:.1f} degrees")
assert paths.closed.all()
assert total["joints_linked"] > 2.9
assert total["crossings"] == 0

# %% [markdown]
# ## Dense strands
#
# Zhang et al. (arXiv:2410.16851) fill such layers: strands side by side along the tension, which end
# where it converges. Here `stripes`, whose strands are never shorter than the cutter allows, beside
# the rings above on some of the layers. Both on the T-bracket, beside the authors' own strands, are
# `ccfem reproduce zhang_2025`.

# %%
some = [layer for layer in sliced.layers if layer.index in paths.layer][::5]
dense = plan(create("stripes"), some, stress, case.machine)
rings = paths.select(np.isin(paths.layer, [layer.index for layer in some]))
filled = {}
for name, strands in (("winding", rings), ("stripes", dense)):
    filled[name] = evaluate(strands, some, stress, case.machine, build=case.build).total
    covered, angle = filled[name]["coverage"], filled[name]["angle_mean"]
    print(f"{name}: {covered:.0%} of the layers covered, {angle:.0f} degrees to the tension")
assert dense.lengths.min() >= case.machine.minimum_length
assert filled["stripes"]["coverage"] > 1.5 * filled["winding"]["coverage"]
assert filled["stripes"]["angle_mean"] < filled["winding"]["angle_mean"]

# %% [markdown]
# ## What it asks of the robot
#
# The head stands on its layer: it tilts from the build direction as the layers do, here by a right
# angle on the way from the flange to the eye, and a wide head would run into layers printed before.

# %%
print(f"the head tilts by {total['tilt_mean']:.0f} degrees in the mean")
slim = replace(case.machine, head_angle=10.0)
found = evaluate(paths, sliced.layers, stress, slim, build=case.build).total
hits = {case.machine.head_angle: total["head_collision"], 10.0: found["head_collision"]}
for angle in hits:
    print(f"a cone of {angle:.0f} degrees to its axis meets them at {hits[angle]:.0%} of the fibre")
assert hits[10.0] < hits[35.0]

# %% [markdown]
# ## Against flat layers
#
# `ccfem compare lifting_eye --slicings planar:z,spatial --strategies winding,concentric` gives one
# table at equal fibre, with the verdict of the virtual test as it comes out. Here only what the
# strands above do for the part.

# %%
test = virtual_test(paths, stress, span=())
print(f"{test.ratio:.2f} times the stiffness without fibre")
assert test.ratio > 1.1
