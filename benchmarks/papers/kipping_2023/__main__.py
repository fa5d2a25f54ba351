"""Run the study of Kipping and Schueppstuhl 2023: tables, figures, and the claims beside ours.

    python -m benchmarks.papers.kipping_2023 FOLDER

takes some minutes.
"""

import json
import sys
from pathlib import Path

from benchmarks.papers.kipping_2023.chain import PARTS, chain, table_1, table_2
from benchmarks.papers.kipping_2023.claims import quantities, support_table, verdicts
from benchmarks.papers.kipping_2023.figures import part_figures, senses_figure
from benchmarks.papers.kipping_2023.fiso_shapes import options_table, shapes_picture, shapes_table
from benchmarks.papers.kipping_2023.strength import failure_loads, strength_table
from benchmarks.papers.kipping_2023.trade import trade, trade_picture, trade_table
from benchmarks.papers.verdicts import claim_table


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    chains = {part: chain(name) for part, name in PARTS.items()}
    tables = [table_1(chains), table_2(chains), support_table(chains)]
    print("\n".join(tables), flush=True)
    trades = {part: trade(run) for part, run in chains.items()}
    loads = {part: failure_loads(run) for part, run in chains.items()}
    shapes, strands = shapes_table()
    tables += [trade_table(trades), strength_table(loads), shapes, options_table()]
    print("\n".join(tables[3:]), flush=True)
    pictures = {"figure_7.png": shapes_picture(strands), "trade.png": trade_picture(trades)}
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


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/kipping_2023"))
