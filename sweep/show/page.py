"""One result as one self-contained page of HTML: question, figures, exponents, parameters, statuses, provenance.

No script, no font and no picture from elsewhere: the file alone can be mailed, put on a server, printed, and read on a
phone.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from sweep.errors import SweepError
from sweep.file import disk
from sweep.results.statuses import is_summary
from sweep.show.laws import explanation, law_rows
from sweep.show.text import Rows, head, outputs_of, sections

if TYPE_CHECKING:
    import xarray as xr

    from sweep.show.laws import Laws

MOST_FIGURES = 6
MOST_LINES = 8
"""Lines of a family whose exponents are given."""

HEADINGS = {
    "": (),
    "axes": ("axis", "unit", "values", "from, to", "meaning"),
    "reduced over": ("axis", "unit", "values", "from, to", "meaning"),
    "fixed": ("parameter", "unit", "value", "meaning"),
    "along": ("coordinate", "unit", "values", "from, to", "meaning"),
    "outputs": ("output", "unit", "from, to", "meaning"),
    "reductions": ("reduction", "unit", "value", "meaning"),
    "status": ("cells", "status", "meaning, and where"),
    "methods used": ("method", "cells", "share"),
}

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 Georgia, 'Times New Roman', serif; color: #111; background: #fff; margin: 0 auto;
  max-width: 62rem; padding: 1rem 1.2rem 3rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: .6rem 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; border-bottom: 1px solid #bbb; padding-bottom: .15rem; }
p.question { font-size: 1.15rem; font-style: italic; margin: .2rem 0 .8rem; }
p.account, figcaption, p.note { color: #444; font-size: .9rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 25rem), 1fr)); gap: 1.2rem; }
figure { margin: 0; break-inside: avoid; }
figure img { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid #e2e2e2; }
th { font-weight: 600; border-bottom: 1px solid #888; white-space: nowrap; }
td:first-child { white-space: nowrap; }
td:last-child { min-width: 11rem; }
code, pre { font-family: ui-monospace, Menlo, Consolas, monospace; font-size: .82rem; }
pre { background: #f6f6f4; padding: .8rem; overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere; }
@media (max-width: 34rem) { table { font-size: .78rem; } th, td { padding-right: .5rem; overflow-wrap: break-word; }
  td:last-child { min-width: 6.5rem; } }
@media print { body { font-size: 10.5pt; max-width: none; padding: 0; } h2 { break-after: avoid; }
  table { font-size: 8.5pt; } tr { break-inside: avoid; } .figures { grid-template-columns: 1fr 1fr; } }
"""


def write_page(dataset: xr.Dataset, result: Path, path: str | os.PathLike[str]) -> Path:
    """Write the page of a result; a file that is there is replaced once all is written.

    Parameters
    ----------
    dataset : Dataset
        From `open_result`.
    result : path
        Where it came from, for the page to name.
    path : path
        The page, .html.

    Raises
    ------
    SweepError
        The file cannot be written.
    """
    target = Path(path)
    with disk.replacing(target) as part:
        part.write_text(page(dataset, result), encoding="utf-8")
    return target


def page(dataset: xr.Dataset, result: Path) -> str:
    """The page as text."""
    attrs = dataset.attrs
    title = str(attrs.get("title") or result.stem)
    name, *texts = head(Path(result.name), dataset)
    tables = sections(dataset)
    settings = tables.pop("")
    parts = [
        f"<h1>{escape(title)}</h1>",
        *(f'<p class="question">{escape(text)}</p>' for text in texts[:-1] if text != title),
        f'<p class="account">{escape(name)}. {escape(texts[-1])}.</p>',
        *_figures(dataset),
        *_exponents(dataset),
        *(_section(heading, rows) for heading, rows in tables.items()),
        "<h2>provenance</h2>",
        _table((), settings),
        *_study(attrs),
        f'<p class="note">Fingerprint of study, sources and versions: <code>{escape(_fingerprint(attrs))}</code>.</p>',
    ]
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="generator" content="foliot">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _figures(dataset: xr.Dataset) -> Iterator[str]:
    """A picture of each of the first outputs that can be drawn."""
    if is_summary(dataset):
        return
    names = [name for name in outputs_of(dataset) if bool(dataset[name].notnull().any())]
    found = [picture for name in names[:MOST_FIGURES] if (picture := _picture(dataset, name))]
    if found:
        yield '<h2>figures</h2>\n<div class="figures">' + "\n".join(found) + "</div>"


def _picture(dataset: xr.Dataset, name: str) -> str:
    from sweep.show.charts import style
    from sweep.show.plot import plot

    try:
        figure = plot(dataset.assign_attrs(title=""), y=name)
    except SweepError:
        return ""  # no axis of numbers, or no number to draw
    store = io.BytesIO()
    with style():
        figure.savefig(store, format="png", dpi=220, metadata={"Software": None})
    data = base64.b64encode(store.getvalue()).decode("ascii")
    caption = escape(str(dataset[name].attrs.get("long_name", name)))
    return (
        f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(name)}: {caption}</figcaption></figure>"
    )


def _exponents(dataset: xr.Dataset) -> Iterator[str]:
    """Power laws along the first logarithmic axis, of outputs that have a unit."""
    from sweep.laws.loglog import is_logarithmic

    if is_summary(dataset):
        return
    axes = [str(d) for d in dataset["status"].dims if d in dataset.coords and dataset[d].dtype.kind in "fiu"]
    axis = next((name for name in axes if is_logarithmic(dataset[name].values)), None)
    if axis is None or dataset["status"].size // dataset.sizes[axis] > MOST_LINES:
        return
    names = [name for name in outputs_of(dataset) if dataset[name].attrs.get("units", "1") != "1"]
    rows = [row for name in names if (found := _laws(dataset, name, axis)) for row in law_rows(found)]
    if rows:
        head = ("output", "over", "exponent", "interval", "largest misfit")
        note = explanation(0.95)
        yield f"<h2>exponents in {escape(axis)}</h2>\n{_table(head, rows)}\n<p class='note'>{escape(note)}</p>"


def _laws(dataset: xr.Dataset, name: str, axis: str) -> Laws | None:
    from sweep.show.laws import laws

    if dataset[name].dims != dataset["status"].dims or not bool((dataset[name] > 0).any()):
        return None
    try:
        return laws(dataset.where(dataset[name] > 0), name, axis)
    except SweepError:
        return None


def _section(title: str, rows: Rows) -> str:
    return f"<h2>{escape(title)}</h2>\n{_table(HEADINGS.get(title, ()), rows)}"


def _table(heading: Sequence[str], rows: Rows) -> str:
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in heading)
    top = f"<thead><tr>{cells}</tr></thead>" if heading else ""
    lines = ("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table>{top}<tbody>{"".join(lines)}</tbody></table></div>'


def _study(attrs: dict[str, object]) -> Iterator[str]:
    if attrs.get("study"):
        yield f"<h2>study</h2>\n<pre>{escape(str(attrs['study']))}</pre>"


def _fingerprint(attrs: dict[str, object]) -> str:
    import hashlib

    return hashlib.sha256(str(attrs.get("fingerprint", "")).encode()).hexdigest()[:16]
