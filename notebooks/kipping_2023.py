# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # Layers with no tension across them
#
# Kipping and Schueppstuhl (Materials 16 (2023) 998): layers are weakest across, so they are laid
# square to the least principal stress where the part is loaded most, and each is printed as one
# strand from its middle outwards. Here: an arm bracket of the size of their part B. Both parts,
# all tables and the claims beside ours are `ccfem reproduce kipping_2023`.

# %%
import numpy as np
import shapely

from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.paths.planning import plan
from ccfem.strategies import create
from ccfem.printing.support import support_columns

case = create_case("arm_bracket")
stress = solve(case.problem)["lift"]
print(f"{len(stress.mesh.cells)} cells")

# %% [markdown]
# ## Layers
#
# The share of the tension that acts across layers, in the cells where the stress is high: along
# the stress, along the build direction, and for the best of all planes.

# %%
sliced = case.slicing.slice(stress)
ours, flat, best = sliced.across, sliced.across_build, sliced.across_best
print(f"{len(sliced.layers)} layers in {sliced.regions.count} regions")
print(f"tension across: {ours.tension:.3f}, flat {flat.tension:.3f}, best plane {best.tension:.3f}")
assert sliced.inverted == 0.0
assert ours.tension < 0.9 * best.tension <= 0.9 * flat.tension

# %% [markdown]
# Every cell keeps its distance of layers between 0.2 and 0.5 mm.

# %%
thickness = sliced.step / np.linalg.norm(sliced.field.gradient, axis=1)
print(f"{thickness.min():.2f} to {thickness.max():.2f} mm")
assert 0.19 < thickness.min() < thickness.max() < 0.51

# %% [markdown]
# ## Strands
#
# First in, spiral out: one strand a region of the layer, from its middle to its border.

# %%
some = sliced.layers[20:24]
paths = plan(create("fiso", {"turns": "tight"}), some, stress, case.machine)
print(f"{len(paths)} strands, {paths.lengths.sum():.0f} mm on {len(some)} layers")
area = sum(layer.areas.sum() for layer in some)
assert 0.85 * area < case.machine.fibre_width * paths.lengths.sum() < 1.1 * area
assert shapely.is_simple([shapely.linestrings(path[:, :2]) for path in paths]).all()

# %% [markdown]
# ## Support
#
# The layers go on below the part: what has to be filled there, and how much of the part rests on
# it. Flat layers carry walls that lean by 45 degrees; upright, this part needs little.

# %%
ours = support_columns(stress.mesh, sliced.field.up.tolist(), lift=3.5, pitch=0.5)
flat = support_columns(stress.mesh, angle=45.0, pitch=0.5)
print(f"along the stress {ours.volume:.0f} mm^3 on {ours.contact:.0f} mm^2 of the part")
print(f"flat {flat.volume:.0f} mm^3 on {flat.contact:.0f} mm^2")
assert flat.volume < ours.volume
