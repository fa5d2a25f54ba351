"""The curve of a comparison in its report."""

from html import escape

import numpy as np

from ccfem.comparison.curve import Curve
from ccfem.comparison.headline import headline_values
from ccfem.comparison.html import figure, grid, number

__all__ = ["curve_section"]


def curve_section(curve: Curve | None, picture: bytes) -> str:
    """Return the section of the report with the curve, drawn and as a table; "" without one."""
    if curve is None:
        return ""
    rows = []
    for name, points in curve.points.items():
        for wanted, run in points:
            values = headline_values(run)
            cells = [
                f"{wanted:.0f}",
                f"{run.length_per_layer:.0f}",
                *(
                    number(values.get(column, np.nan))
                    for column in ("stiffness_ratio_tension", "stiffness_ratio_bonded")
                ),
                run.failure or run.why_not or "yes",
            ]
            text = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
            rows.append(f"<tr><td>{escape(name)}</td>{text}</tr>")
    heads = ("wanted, mm a layer", "laid", "stiffness ×, tension only", "bonded", "printable")
    titles = "".join(f"<th>{escape(head)}</th>" for head in heads)
    common = curve.common
    marked = ", ".join(f"{length:.0f}" for length in common)
    said = f"All reach {marked} mm a layer." if common else "There is no length that all reach."
    return (
        "<h2>Stiffness over fibre</h2>\n"
        f'<p class="note">{said} Hollow marks cannot be printed as planned. Numbers are also in '
        f"curve.csv.</p>\n{grid([figure(picture, 'stiffness over length of fibre'), ''])}"
        f'<details><summary>Table</summary><table class="narrow"><tr><th>strategy</th>{titles}'
        f"</tr>{''.join(rows)}</table></details>\n"
    )
