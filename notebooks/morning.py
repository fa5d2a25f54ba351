# %% [markdown]
# # A morning: own part, own strategy, a sweep, a report
#
# After `pip install ccfem`. The part is an eye that is pulled at its pin; lengths mm, forces N.

# %%
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import ccfem
from ccfem.paths.planning import Amount

folder = Path(tempfile.mkdtemp())
(folder / "eye.toml").write_text("""
layers = 1
order = 1
material = "pla"
planform.outline = [[0, -12], [70, -12], [82, 0], [70, 12], [0, 12]]
planform.holes = [{ centre = [64, 0], radius = 5.0 }]
planform.height = 3.0
planform.edge_length = 2.5
patches.foot = { rule = "plane", normal = "x", offset = "min" }
patches.pin = { rule = "cylinder", point = [64, 0, 0], axis = "z", radius = 5.0 }
supports = [{ patch = "foot" }]
loads.pull = [{ kind = "bearing", patch = "pin", vector = [300, 0, 0] }]
""")
print(ccfem.check(folder / "eye.toml"))

# %% [markdown]
# A strategy of one's own is a small class. It is compared with those that ccfem brings.

# %%
@dataclass(frozen=True)
class Rows:
    """Straight rows along the part."""

    spacing: float = 1.0
    amount: ClassVar[Amount] = Amount("spacing", 1.0, 20.0)

    def __call__(self, layer, stress, machine):
        return ccfem.strategies.Zigzag(self.spacing, angle=0.0, turn=0.0)(layer, stress, machine)

case = ccfem.read(folder / "eye.toml")
comparison = ccfem.compare(case, ["concentric", "zigzag", Rows()], curve=False)
print(comparison)

# %% [markdown]
# Three densities of each, stored run by run; what is on the front of stiffness over fibre.

# %%
spacings = {"spacing": [2.0, 3.0, 4.0]}
rows = [Rows(spacing) for spacing in spacings["spacing"]]
swept = [{"name": name, "sweep": spacings} for name in ("concentric", "zigzag")]
result = ccfem.study(ccfem.Study([case], [*swept, *rows]), folder / "sweep", workers=0)
print(result.front()[["strategy", "strategy.spacing", "fibre_length", "stiffness"]])
report = ccfem.save(comparison, folder / "eye")

# %%
assert len(result.frame) == 9 and not result.frame["failure"].any()
assert result.front()["stiffness"].is_monotonic_increasing or len(result.front()) > 1
print(report.name, report.stat().st_size > 10_000)
