"""Whether paths can be printed as they are, and what breaks it where they cannot."""

from collections.abc import Mapping
from dataclasses import dataclass

from ccfem.machine.machine import Machine


@dataclass(frozen=True)
class _Rule:
    """One thing that breaks a print: an index, the field of `Limits` that bounds it, and words."""

    limit: str
    words: str
    pattern: str = "{:.0%}"


_RULES = (
    _Rule(
        "short", "{found} of the fibre lies in paths shorter than {machine.shortest_strand:g} mm"
    ),
    _Rule("tight", "{found} of the fibre turns tighter than {machine.minimum_radius:g} mm"),
    _Rule("on_fibre", "{found} of the fibre lies on other fibre of its direction"),
    _Rule("across_fibre", "{found} of the fibre lies across other fibre"),
    _Rule("outside", "{found} of the strands, by their width, lies outside the part"),
    _Rule(
        "outside_height",
        "{found} of the fibre stands out of the part's top or bottom, with strands "
        "{machine.strand_height:.2g} mm high",
    ),
    _Rule("free_span", "fibre hangs free over {found}", "{:.3g} mm"),
    _Rule("links", "{found} of the fibre is marked as links"),
    _Rule("fraction", "a fibre volume fraction of {found}", "{:.2f}"),
)


def why_not(total: Mapping[str, float], machine: Machine) -> tuple[str, ...]:
    """Say what keeps paths from being printed as they are, the worst first.

    Parameters
    ----------
    total : mapping
        Indices of the whole part (`Evaluation.total`).
    machine : Machine
        With its limits.

    Returns
    -------
    tuple of str
        Each names what was found and what the machine tolerates. An index that is NaN, as without
        fibre, breaks no limit.
    """
    reasons = _bounded_values(total)
    broken = []
    for rule in _RULES:
        value, limit = reasons[rule.limit], getattr(machine.limits, rule.limit)
        if value > limit:
            said = rule.words.format(found=rule.pattern.format(value), machine=machine)
            excess = value / limit if limit > 0.0 else float("inf")
            broken.append((-excess, f"{said} (limit {rule.pattern.format(limit)})"))
    if reasons["order"] > 0.0:
        said = f"{reasons['order']:.0f} paths come after one of a higher layer"
        broken.append((-float("inf"), said))
    # Flat layers may be thick: matrix fills them in several lines.
    thick = total["thickness_95"]
    if total["tilt_mean"] > 0.0 and thick > machine.matrix_width:
        said = (
            f"curved layers up to {thick:.2g} mm thick, more than a line of matrix is wide "
            f"({machine.matrix_width:g} mm): cut more layers"
        )
        broken.append((-thick / machine.matrix_width, said))
    return tuple(said for _, said in sorted(broken))


def _bounded_values(total: Mapping[str, float]) -> dict[str, float]:
    """Value that each limit bounds."""
    links = total["link_inside"] + total["link_over_void"] + total["link_outside"]
    length = total["fibre_length"]
    return {
        "short": 1.0 - total["long_enough_length"],
        "tight": 1.0 - total["curvature_ok"],
        "on_fibre": total["on_fibre"],
        "across_fibre": total["across_fibre"],
        "outside": total["outside_width"],
        "outside_height": total["outside_height"],
        "free_span": total["free_span"],
        "links": links / length if length > 0.0 else 0.0,
        "fraction": total["fibre_fraction_99"],
        "order": total["out_of_order"],
    }
