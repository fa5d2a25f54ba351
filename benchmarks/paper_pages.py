"""Write the pages of the papers in the documentation: their claims and tables beside ours.

Run ``python -m benchmarks.paper_pages PAPER...`` whenever a result of a paper changes; without a
paper all are made again, which takes an hour. ``--from FOLDER`` takes the tables that ``ccfem
reproduce PAPER --out FOLDER`` wrote there.
"""

import argparse
import re
import shutil
from pathlib import Path

from ccfem.comparison.citations import METHODS, sentence
from ccfem.papers.reproduce import named_papers, reproduce

PAGES = Path(__file__).resolve().parents[1] / "docs" / "papers"

ORDER = ("report", "claims", "tables", "targets", "where_layers_open")
"""Tables in the order of a page; what is in `report` has the others in it."""

HEADINGS = {
    "claims": "Claims",
    "tables": "Tables",
    "targets": "What was aimed at",
    "where_layers_open": "Where layers open first",
}


PICTURES = {"evidence": "figure_01_predicted_over_measured"}
"""Figure of a run that stands on the page, where one does."""


def page(paper: str, folder: Path) -> str:
    """Page of a paper from the tables in the folder of its run."""
    cited = any(paper in keys for keys in METHODS.values())
    parts = [
        f"# {named_papers()[paper].title}",
        *([sentence(paper)] if cited else []),
        f"    ccfem reproduce {paper}",
        "Written by `python -m benchmarks.paper_pages` from one run of that command; times are "
        "those of its machine.",
    ]
    for name in ORDER:
        file = folder / f"{name}.md"
        if not file.exists():
            continue
        text = file.read_text(encoding="utf-8").strip()
        if name == "report":
            text = re.split(r"^## Figures$", text, flags=re.M)[0]
            text = re.sub(r"\A# .*\n+(Written by `.*?`\. ?)?", "", text)
            text = re.sub(r"^Study .* s, figures .* s\.\n+", "", text, flags=re.M)
        else:
            text = f"## {HEADINGS[name]}\n\n{text}"
        parts.append(text.strip())
    if paper in PICTURES:
        parts.insert(3 if cited else 2, f"![{named_papers()[paper].title}]({paper}.png)")
        shutil.copy(folder / f"{PICTURES[paper]}.png", PAGES / f"{paper}.png")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Write the pages of the papers that are named, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("papers", nargs="*", metavar="PAPER")
    parser.add_argument("--from", dest="folder", type=Path, help="folder of a run of one paper")
    given = parser.parse_args()
    papers = given.papers or sorted(named_papers())
    if given.folder is not None and len(papers) != 1:
        parser.error("--from is the run of one paper: name it")
    PAGES.mkdir(exist_ok=True)
    for paper in papers:
        folder = given.folder or reproduce(paper)
        path = PAGES / f"{paper}.md"
        path.write_text(page(paper, folder), encoding="utf-8")
        print(path.name, flush=True)


if __name__ == "__main__":
    main()
