"""One result as one self-contained page of HTML: question, figures, exponents, parameters, statuses, provenance.

It needs no other file, script or font, so it can be mailed, put on a server, printed, and read on a phone.
"""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from sweep.errors import SweepError
from sweep.file import disk
from sweep.results.statuses import is_summary
from sweep.show.laws import law_tables, laws
from sweep.show.text import head, outputs_of, sections, settings
from sweep.words import Table

if TYPE_CHECKING:
    import xarray as xr

MOST_FIGURES = 6
MOST_LINES = 8
"""Largest number of lines of a family with exponents."""

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
th, td { vertical-align: top; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid #e2e2e2; }
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
        The path is no .html, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise SweepError(f"{target}: a report is a page of HTML; name it *.html")
    with disk.replacing(target) as part:
        part.write_text(page(dataset, result), encoding="utf-8")
    return target


def page(dataset: xr.Dataset, result: Path) -> str:
    """The page as text."""
    attrs = dataset.attrs
    title, study = str(attrs.get("title") or result.stem), str(attrs.get("study", ""))
    fingerprint = hashlib.sha256(str(attrs.get("fingerprint", "")).encode()).hexdigest()[:16]
    name, *texts, cells = head(Path(result.name), dataset)
    parts = [
        f"<h1>{escape(title)}</h1>",
        *(f'<p class="question">{escape(text)}</p>' for text in texts if text != title),
        f'<p class="account">{escape(name)}. {escape(cells)}.</p>',
        *([] if is_summary(dataset) else [*_figures(dataset), *_exponents(dataset)]),
        *(_wide(table) for table in sections(dataset)),
        "<h2>provenance</h2>",
        _wide(settings(dataset)),
        f"<h2>study</h2>\n<pre>{escape(study)}</pre>" if study else "",
        f'<p class="note">Fingerprint of study, sources and versions: <code>{fingerprint}</code>.</p>',
    ]
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="generator" content="foliot">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _wide(table: Table) -> str:
    return f'<div class="wide">{table.html()}</div>'


def _figures(dataset: xr.Dataset) -> Iterator[str]:
    """A picture of each of the first outputs that can be drawn."""
    from sweep.show.charts import png
    from sweep.show.figures import plot

    found = []
    for name in [name for name in outputs_of(dataset) if bool(dataset[name].notnull().any())][:MOST_FIGURES]:
        try:
            data = base64.b64encode(png(plot(dataset.assign_attrs(title=""), y=name), 220)).decode("ascii")
        except SweepError:
            continue  # no axis of numbers, or no number to draw
        caption = escape(f"{name}: {dataset[name].attrs.get('long_name', name)}")
        image = f'<img alt="{escape(name)}" src="data:image/png;base64,{data}">'
        found.append(f"<figure>{image}<figcaption>{caption}</figcaption></figure>")
    if found:
        yield '<h2>figures</h2>\n<div class="figures">' + "\n".join(found) + "</div>"


def _exponents(dataset: xr.Dataset) -> Iterator[str]:
    """Power laws along the first logarithmic axis, of outputs that have a unit."""
    from sweep.laws.loglog import is_logarithmic

    status = dataset["status"]
    axes = [str(d) for d in status.dims if d in dataset.coords and dataset[d].dtype.kind in "fiu"]
    axis = next((name for name in axes if is_logarithmic(dataset[name].values)), None)
    if axis is None or status.size // dataset.sizes[axis] > MOST_LINES:
        return
    note = ""
    for name in outputs_of(dataset):
        output = dataset[name]
        if output.attrs.get("units", "1") == "1" or output.dims != status.dims or not bool((output > 0).any()):
            continue
        try:
            found = laws(dataset.where(output > 0), name, axis)
        except SweepError:
            continue
        note = found.explanation
        yield from map(_wide, law_tables(found, complete=True))
    if note:
        yield f"<p class='note'>{escape(note)}</p>"
