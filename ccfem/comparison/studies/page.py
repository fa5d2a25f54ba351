"""The page of a study: its fronts and its table, complete in itself."""

import base64
from html import escape

from ccfem.comparison.plot.canvas import png
from ccfem.comparison.studies.study_fronts import COST
from ccfem.comparison.studies.study_result import StudyResult
from ccfem.comparison.studies.study_table import shown_table

_HEADINGS = {
    "fibre_length": "Stiffness over fibre",
    "print_time_nearest": "Stiffness over the time to lay the fibre",
    "first_failure_load": "Stiffness over failure load",
}


def study_page(result: StudyResult) -> str:
    """Write the page."""
    parts = [f"<h1>{escape(result.name)}</h1><p>{escape(result.about)}</p>"]
    parts += [f'<p class="remark">{escape(line)}</p>' for line in result.remarks]
    for cost in COST:
        if not result.frame[f"front_{cost}"].any():
            continue
        picture = base64.b64encode(png(result.plot(cost))).decode()
        parts.append(
            f"<h2>{_HEADINGS[cost]}</h2>"
            f'<img alt="{_HEADINGS[cost]}" src="data:image/png;base64,{picture}">'
        )
    parts.append(
        "<p>Large points, joined by a line: no other printable run is better in one and as good in "
        "the other. Hollow points cannot be printed as they are. A click on a heading sorts.</p>"
        f'<h2>Runs</h2><div class="wide">{shown_table(result.frame)}</div>'
    )
    body = "\n".join(parts)
    return _PAGE.replace("@TITLE@", escape(result.name)).replace("@BODY@", body)


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>@TITLE@</title>
<style>body{margin:1.5rem auto;max-width:82rem;padding:0 1rem;font:15px/1.45 sans-serif;
color:#1d2430}img{max-width:100%}.wide{overflow-x:auto}table{border-collapse:collapse}
th,td{padding:.25rem .7rem;text-align:left;border-bottom:1px solid #ddd;white-space:nowrap}
th{cursor:pointer;white-space:normal;vertical-align:bottom}.failed{white-space:normal;color:#b3261e}.remark{color:#b3261e}</style></head>
<body>
@BODY@
<script>
for(const head of document.querySelectorAll("th"))head.onclick=()=>{
const table=head.closest("table"),k=head.cellIndex,turn=head.dataset.turn=-(head.dataset.turn||-1),
text=row=>row.cells[k]?row.cells[k].textContent:"";
[...table.rows].slice(1).sort((a,b)=>{const x=text(a),y=text(b);
return turn*(x!==""&&y!==""&&!isNaN(x)&&!isNaN(y)?x-y:x.localeCompare(y));})
.forEach(row=>row.parentNode.append(row));};
</script></body></html>
"""
