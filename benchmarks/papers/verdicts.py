"""Claims of a paper beside ours: a file of claims, judged by the quantities of a run."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Check", "claim_table", "judged"]


@dataclass(frozen=True)
class Check:
    """One number of one claim; `verdict` is "reproduced", "differs" or "not tried"."""

    claim: str
    text: str
    source: str
    quantity: str
    paper: str
    ours: float
    verdict: str
    why: str


def judged(found: Mapping[str, float], path: Path) -> list[Check]:
    """Judge every check of a file of claims by the quantities found."""
    with path.open("rb") as file:
        claims: list[dict[str, Any]] = tomllib.load(file)["claim"]
    checks = []
    for claim in claims:
        for check in claim["checks"]:
            ours = found.get(check["quantity"], np.nan)
            if np.isnan(ours):
                verdict = "not tried"
            else:
                inside = check["low"] - 1e-9 <= ours <= check["high"] + 1e-9
                verdict = "reproduced" if inside else "differs"
            about = (claim["id"], claim["text"], claim["source"])
            why = claim["why"] if verdict != "reproduced" else ""
            checks.append(Check(*about, check["quantity"], check["paper"], ours, verdict, why))
    return checks


def claim_table(checks: list[Check]) -> str:
    """Markdown table claim / paper / ours / verdict, and the reasons below it."""
    lines = ["| claim | source | quantity | paper | ours | verdict |", "|---|---|---|---|---|---|"]
    for k, c in enumerate(checks):
        new = k == 0 or checks[k - 1].claim != c.claim
        head = f"{c.claim} {c.text}" if new else ""
        ours = "–" if np.isnan(c.ours) else f"{c.ours:.4g}"
        lines.append(
            f"| {head} | {c.source if new else ''} | {c.quantity} | {c.paper} | {ours} | "
            f"{c.verdict} |"
        )
    reasons = {c.claim: c.why for c in checks if c.why}
    lines += ["", *(f"- {claim}: {why}" for claim, why in reasons.items())]
    return "\n".join(lines) + "\n"
