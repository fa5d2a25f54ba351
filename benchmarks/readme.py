"""Put the table that ``ccfem compare loop`` prints, and its picture, into the README.

Run ``python benchmarks/readme.py`` whenever a default changes.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACE = re.compile(
    r"(<!-- printed by: python benchmarks/readme.py -->\n```text\n).*?(```\n<!-- end -->)", re.S
)


def main() -> None:
    """Run the comparison and write README.md and docs/loop.png."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "ccfem", "compare", "loop", "--out", folder]
        environment = {**os.environ, "COLUMNS": "100"}
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
        )
        lines = [line.rstrip() for line in done.stdout.splitlines()]
        shown = [line for line in lines[:-1] if line]  # the last one names the temporary folder
        (ROOT / "docs").mkdir(exist_ok=True)
        shutil.copy(Path(folder) / "overview.png", ROOT / "docs" / "loop.png")
    readme = ROOT / "README.md"
    text = "\n".join(shown) + "\n"
    page, count = PLACE.subn(lambda found: found[1] + text + found[2], readme.read_text())
    if count != 1:
        raise SystemExit("README.md has no place for the table: put its two comments back")
    readme.write_text(page)


if __name__ == "__main__":
    main()
