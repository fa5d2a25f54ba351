"""Load over displacement of parts that break, each with the band of its breaking load."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ccfem.comparison.plot.colours import INK
from ccfem.comparison.plot.curves import axes_below, legend_below
from ccfem.judging.virtual_testing.progressive_failure import EXPERIMENT, BreakingLoad

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def breaking_picture(broken: Mapping[str, BreakingLoad], colours: Mapping[str, str]) -> "Figure":
    """Draw load over displacement; a bar at the highest load spans the band, a dot the first crack.

    Parameters
    ----------
    broken : mapping of name to BreakingLoad
    colours : mapping of name to colour
        Of all names but the part without fibre, which is drawn in ink.
    """
    figure, axes = axes_below(f"breaking load ({EXPERIMENT})", "displacement, mm", "load, kN")
    chosen = {name: colours.get(name, INK) for name in broken}
    for name, load in broken.items():
        curve, colour = load.curve, chosen[name]
        axes.plot(curve.displacement, 1e-3 * curve.force, color=colour, lw=1.6)
        axes.plot(curve.displacement[1], 1e-3 * curve.force[1], "o", ms=3.5, color=colour)
        low, high = (1e-3 * end for end in load.band)
        at = curve.displacement[curve.force.argmax()]
        axes.plot([at, at], [low, high], color=colour, lw=4.0, alpha=0.3, solid_capstyle="butt")
    axes.set_ylim(0.0, 1.05e-3 * max(load.band[1] for load in broken.values()))
    axes.set_xlim(left=0.0)
    legend_below(axes, chosen, list(broken))
    return figure
