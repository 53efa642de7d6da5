"""One self-contained HTML file: styles, scripts and data inside, no network."""

import html
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from push_view.bundle import bundle

_PAGE = Path(__file__).parent / "page"
_REPORT = Path(__file__).parent / "report_page"
_STYLES = (_PAGE / "vendor/uPlot.min.css", _PAGE / "page.css", _REPORT / "report.css")
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def page(title: str, body: str, script: str, data: Any) -> str:
    """The text of a file. body: HTML. script: JavaScript. data: is in an element ``data`` as
    JSON."""
    style = "\n".join(path.read_text(encoding="utf-8") for path in _STYLES)
    inline = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{html.escape(title)}</title>
<style>
{style}</style>
</head>
<body class="report">
{body}
<script type="application/json" id="data">{inline}</script>
<script>
{script}</script>
</body>
</html>
"""


def frame() -> str:
    """The elements of the page in which a bag is played back."""
    text = (_PAGE / "index.html").read_text(encoding="utf-8")
    inside = text[text.index("<body>") + len("<body>") : text.index("</body>")]
    return f'<div class="frame" id="frame">{inside}</div>'


def player() -> str:
    """The script that plays back the bags of the element ``data``."""
    plot = (_PAGE / "vendor/uPlot.iife.min.js").read_text(encoding="utf-8")
    begin = 'modules.play.begin({data: JSON.parse(document.getElementById("data").textContent)});'
    return f"{plot}\n{bundle('play')}\n{begin}\n"


def study_script() -> str:
    """The script of the report of a study."""
    return (_REPORT / "study.js").read_text(encoding="utf-8")


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]], kind: str = "") -> str:
    """An HTML table; a cell that is a number is set to the right. kind: its class."""
    text = "".join(f"<th>{html.escape(head)}</th>" for head in heads)
    lines = [f'<div class="wide"><table class="{kind}"><thead><tr>{text}</tr></thead><tbody>']
    for row in rows:
        cells = "".join(_cell(value) for value in row)
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</tbody></table></div>"])


class Markup(str):
    """Text that is HTML already."""


def _cell(value: Any) -> str:
    if isinstance(value, Markup):
        return f"<td>{value}</td>"
    if isinstance(value, bool):
        return f"<td>{'yes' if value else 'no'}</td>"
    if isinstance(value, (int, float)):
        return f'<td class="number" data-value="{value}">{shown(value)}</td>'
    return f"<td>{html.escape(str(value))}</td>"


def shown(value: float) -> str:
    """A number with four digits at most, a dash if it is not finite."""
    if value != value or value in (float("inf"), float("-inf")):
        return "–"
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 1e6):
        return str(int(value))
    return f"{value:.4g}"
