"""The whole of the paper: its study, figures, tables and claims beside ours."""

import json
from pathlib import Path

from ccfem.base.progress import Progress, silent
from ccfem.papers.kipping_2023.chain import PARTS, Chain, chain, table_1, table_2
from ccfem.papers.kipping_2023.claims import quantities, support_table, verdicts
from ccfem.papers.kipping_2023.figures import part_figures, senses_figure
from ccfem.papers.kipping_2023.fiso_shapes import options_table, shapes_picture, shapes_table
from ccfem.papers.kipping_2023.strength import (
    failure_loads,
    on_pressing_supports,
    sliding_picture,
    strength_table,
)
from ccfem.papers.kipping_2023.trade import trade, trade_picture, trade_table
from ccfem.papers.verdicts import claim_table


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    chains: dict[str, Chain] = {}
    for part, name in PARTS.items():
        progress(f"planning part {part}", len(chains) / len(PARTS))
        chains[part] = chain(name)
    tables = [table_1(chains), table_2(chains), support_table(chains)]
    print("\n".join(tables), flush=True)
    trades = {part: trade(run) for part, run in chains.items()}
    loads = {part: failure_loads(run) for part, run in chains.items()}
    pressed = on_pressing_supports(chains["B"])
    loads["B, pressed"] = failure_loads(chains["B"], pressed)
    shapes, strands = shapes_table()
    tables += [trade_table(trades), strength_table(loads), shapes, options_table()]
    print("\n".join(tables[3:]), flush=True)
    pictures = {"figure_7.png": shapes_picture(strands), "trade.png": trade_picture(trades)}
    models = {"holes held": chains["B"].stress, "supports press": pressed}
    pictures["sliding_B.png"] = sliding_picture(chains["B"], models)
    pictures["figure_1_3.png"] = senses_figure()[0]
    for part, run in chains.items():
        pictures |= part_figures(part, run)
    for name, picture in pictures.items():
        (folder / name).write_bytes(picture)
    (folder / "tables.md").write_text("\n".join(tables), encoding="utf-8")
    found = quantities(chains, trades, loads, strands)
    (folder / "quantities.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    claims = claim_table(verdicts(found))
    (folder / "claims.md").write_text(claims, encoding="utf-8")
    print(claims)
