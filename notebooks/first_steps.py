# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # First steps
#
# From a loaded part to compared fibre paths. Every arrow is one function:
#
#     TetMesh -> Problem -> StressField -> Layers -> Strategy -> Toolpaths -> Evaluation
#
# Units are mm, N and MPa.

# %%
import numpy as np

import ccfem

# %% [markdown]
# ## A part with its load
#
# A case is a mesh with named patches, a material, supports and loads, and a machine. Coarse
# elements keep this short.

# %%
case = ccfem.read("loop", element_size=5.0)
print(case.title)
print(len(case.problem.mesh.cells), "tetrahedra, patches", ", ".join(case.problem.mesh.patches))

# %% [markdown]
# ## Stress
#
# One stress field a load case. Every solve says how it went, and the supports must hold what pulls.

# %%
stress = ccfem.solve(case.problem)["pull"]
print(stress.record)
pull = np.array([0.0, 1000.0, 0.0])
assert np.allclose(stress.reactions.sum(axis=0), -pull, atol=1e-3)

# %% [markdown]
# ## Layers and paths
#
# A strategy is a small value whose fields are its parameters.

# %%
layers = ccfem.slice(stress, 3, case.build)
paths = ccfem.plan(ccfem.strategies.Isocurve(cap=90.0), layers, stress, case.machine)
print(len(paths), "paths,", round(paths.lengths.sum() / 1000.0, 2), "m of fibre")
assert paths.lengths.min() >= case.machine.minimum_length

# %% [markdown]
# ## Evaluation
#
# Every index for each layer and in total; `to_frame` gives a table.

# %%
evaluation = ccfem.evaluate(paths, layers, stress, case.machine)
print(evaluation.to_frame()[["fibre_length", "paths", "efficiency", "curvature_95"]])
assert evaluation.total["outside_length"] == 0.0

# %% [markdown]
# ## Comparison
#
# Strategies at equal length of fibre, ranked by the stiffness that the virtual test predicts: the
# part is solved again with the fibres in it.

# %%
comparison = ccfem.compare(case, ["isocurve", "concentric", "zigzag", "contour_zigzag"], layers=3)
print(comparison)
comparison.plot()  # the middle layer; comparison.pareto() draws stiffness over fibre

# %% [markdown]
# The headline: fibre along the tension makes the stiffest part, by a wide margin.

# %%
best, second = comparison.ranking[:2]
assert best.name == "isocurve"
gain = best.tested.bracket.tension.stiffness / second.tested.bracket.tension.stiffness
assert gain > 1.2
# Nobody laid more than the common length, and the order holds with some compression in the fibre.
assert all(run.length_per_layer <= 1.01 * comparison.fibre_per_layer for run in comparison.runs)
assert comparison.verdict.startswith("isocurve makes the stiffest part")
