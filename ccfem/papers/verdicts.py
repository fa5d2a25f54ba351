"""Claims of a paper beside ours: a file of claims, judged by the quantities of a run."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Check:
    """One number of one claim; `verdict` is "reproduced", "differs", "undecided" or "not tried".

    `low` to `high` counts as reproduced: what the paper says, widened by `tolerance`. Nearer to
    either than the resolution of what measured it, a number is undecided.
    """

    claim: str
    text: str
    source: str
    quantity: str
    paper: str
    low: float
    high: float
    tolerance: str
    ours: float
    verdict: str
    why: str


def judged(found: Mapping[str, float], path: Path) -> list[Check]:
    """Judge every check of a file of claims by the quantities found.

    A claim's `resolution` is that of its numbers, 0 where none stands there.
    """
    with path.open("rb") as file:
        claims: list[dict[str, Any]] = tomllib.load(file)["claim"]
    checks = []
    for claim in claims:
        for check in claim["checks"]:
            ours = found.get(check["quantity"], np.nan)
            low, high = check["low"], check["high"]
            if np.isnan(ours):
                verdict = "not tried"
            else:
                inside = low - 1e-9 <= ours <= high + 1e-9
                near = min(abs(ours - low), abs(ours - high)) < claim.get("resolution", 0.0)
                verdict = "undecided" if near else "reproduced" if inside else "differs"
            about = (claim["id"], claim["text"], claim["source"])
            why = claim["why"] if verdict != "reproduced" else ""
            said = (check["quantity"], check["paper"], low, high, claim["tolerance"])
            checks.append(Check(*about, *said, ours, verdict, why))
    return checks


def claim_table(checks: list[Check]) -> str:
    """Markdown table claim / paper / ours / verdict; tolerances and reasons below it."""
    head = ["claim", "source", "quantity", "paper", "counts as reproduced", "ours", "verdict"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for k, c in enumerate(checks):
        new = k == 0 or checks[k - 1].claim != c.claim
        claim = f"{c.claim} {c.text}" if new else ""
        ours = "–" if np.isnan(c.ours) else f"{c.ours:.4g}"
        lines.append(
            f"| {claim} | {c.source if new else ''} | {c.quantity} | {c.paper} | {_range(c)} | "
            f"{ours} | {c.verdict} |"
        )
    tolerances = {c.claim: c.tolerance for c in checks if c.tolerance}
    reasons = {c.claim: c.why for c in checks if c.why}
    lines += ["", "Tolerance of each claim:", ""]
    lines += [f"- {claim}: {tolerance}" for claim, tolerance in tolerances.items()]
    lines += ["", "Where ours differs, is undecided or was not tried:", ""]
    lines += [f"- {claim}: {why}" for claim, why in reasons.items()]
    return "\n".join(lines) + "\n"


def _range(check: Check) -> str:
    """Write what counts as reproduced; a million stands for no limit."""
    if check.low == check.high:
        return f"{check.low:g}"
    return f"from {check.low:g}" if check.high >= 1e6 else f"{check.low:g} to {check.high:g}"
