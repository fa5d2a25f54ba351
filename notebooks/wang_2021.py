# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # Fibre along the load paths of an optimised part
#
# Wang et al. (Composites Part A 140 (2021) 106181) first shape a part by topology optimisation,
# then lay one continuous fibre along its members: stress vector tracing. Here: their bridge in
# three-point bending, 185 x 50 mm. All five plates, all figures and the claims beside ours are
# `ccfem reproduce wang_2021`.

# %%
from dataclasses import replace

import numpy as np

from ccfem.slicing.layers.layer import stress_on
from ccfem.cases import create_case
from ccfem.cases.designed import PLATES
from ccfem.fem.elasticity import solve
from ccfem.fem.plates import solve_plane
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.matching import THRESHOLDS, matching_rate
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.judging.virtual_testing.equilibrium import BONDED
from ccfem.judging.virtual_testing.strand import RHO, Strand
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.slicing.slicers.planar import Planar
from ccfem.paths.planning import plan
from ccfem.strategies import create
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.paths.toolpaths import Toolpaths

plate = PLATES["bridge"]
full = solve_plane(plate.problem)["down"]
print("full plate of the laminate: compliance", round(2.0 * full.strain_energy, 3), "N mm")
assert abs(2.0 * full.strain_energy - 9.13) < 0.05

# %% [markdown]
# ## What the optimisation does to the stress
#
# The optimised part is stored (`plate.design()` finds it again, in some seconds). In the full plate
# most places are pulled one way and pressed the other; in the members of the part one principal
# stress prevails.


# %%
def prepared(optimised):
    """Case, stress of the part, and its one layer."""
    case = create_case("bridge", optimised=optimised, element_size=3.0)
    field = solve(case.problem)["down"]
    (layer,) = Planar(count=1).cut(case.problem.mesh)
    return replace(case.machine, minimum_length=0.0), field, layer


def uniaxial(stress):
    """Share of the area where one principal stress is five times the other."""
    layer = stress.layer
    plane = in_plane(stress.nodal, layer.plane.frame)[layer.triangles].mean(axis=1)
    sizes = np.sort(np.abs(np.stack(largest_in_plane(plane)[:2])), axis=0)
    return float(layer.areas[sizes[1] >= 5.0 * sizes[0]].sum() / layer.areas.sum())


parts = {name: prepared(name == "optimised") for name in ("optimised", "full")}
shares = {name: uniaxial(stress_on(layer, field)) for name, (_, field, layer) in parts.items()}
part = plate.part
print(f"part: {part.area / plate.domain.area:.3f} of the plate, {len(part.interiors)} windows")
print("uniaxial:", {name: round(share, 2) for name, share in shares.items()})
assert len(part.interiors) == 5
assert shares["optimised"] > shares["full"] + 0.25

# %% [markdown]
# ## One path
#
# Strategy `svt` joins the members to main load paths, fills each with parallel strands, and links
# all of them outside the part. The slicer's patterns are laid on the part and on the full plate.

# %%
strategies = {
    "svt": create("svt"),
    "concentric": create("concentric", {"joined": False, "filled": True, "turns": "tight"}),
    "zigzag 45": create("zigzag", {"angle": 45.0, "turns": "tight"}),
    "zigzag 90": create("zigzag", {"angle": 90.0, "turns": "tight"}),
}
laid, indices, rates = {}, {}, {}
for where, (machine, field, layer) in parts.items():
    for name, strategy in strategies.items():
        if where == "full" and name == "svt":
            continue
        paths = plan(strategy, (layer,), field, machine)
        laid[where, name] = paths
        if where == "optimised":
            indices[name] = evaluate(paths, (layer,), field, machine).total
        rates[where, name] = 100.0 * matching_rate(paths, [stress_on(layer, field)], step=0.9)

svt = indices["svt"]
print(f"{svt['fibre_length'] / 1000.0:.2f} m in {svt['paths']:.0f} path")
print(f"{svt['print_time']:.0f} s, {100.0 * svt['coverage']:.1f} % covered")
print(f"links: {svt['link_outside']:.0f} mm outside, {svt['link_inside']:.0f} mm inside")
assert svt["paths"] == 1
assert svt["coverage"] > 0.95
assert svt["link_inside"] < 0.01 * svt["fibre_length"]

# %% [markdown]
# ## How well fibre and stress match
#
# Beside patterns on the full plate `svt` leads by far. On the optimised part plain rings match as
# well or better: the members are slim, rings follow them too, and where strands of `svt` cross in
# a joint one family does not match.

# %%
at = [int(np.flatnonzero(angle == THRESHOLDS)[0]) for angle in (10.0, 20.0, 30.0)]
for (where, name), rate in rates.items():
    print(f"{where:9s} {name:10s} within 10, 20, 30 degrees:", np.round(rate[at], 1), "%")
others = np.max([rate for (where, _), rate in rates.items() if where == "full"], axis=0)
assert (rates["optimised", "svt"][at] > others[at] + 15.0).all()
lead = rates["optimised", "svt"][at] - rates["optimised", "concentric"][at]
assert np.abs(lead).max() < 5.0

# %% [markdown]
# ## What that is worth
#
# The part is solved again with its fibre: all patterns with the same volume of it in the part,
# bonded in tension and compression. There `svt` wins, though rings match as well: its strands go
# through the joints, rings turn round in them.

# %%
_, field, layer = parts["optimised"]
stiffness = {}
for name in strategies:
    lines = plane_paths(laid["optimised", name], layer).in_part
    fibre = Toolpaths.from_plane(np.split(lines.points, lines.offsets[1:-1]), layer)
    strand = Strand(RHO / indices[name]["overfill"])
    bonded = virtual_test(fibre, field, strand, BONDED, span=())
    stiffness[name] = bonded.stiffness / bonded.unreinforced_stiffness
print("stiffness over that without fibre:", {k: round(v, 2) for k, v in stiffness.items()})
assert stiffness["svt"] > 1.05 * stiffness["concentric"]
assert stiffness["concentric"] > 2.0 * stiffness["zigzag 45"]
