"""Pages that are made of what is in the tree: a page of each kernel, the gallery of studies, the commands.

Called by `conf.py`; nothing here is written by hand twice.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import itertools
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import sweep
from kernels import catalogue
from kernels.interface import Field, Kernel, Method
from sweep.cli import COMMANDS
from sweep.command.options import Option
from sweep.show.kernels import starter
from sweep.study.mistakes import limits

ROOT = Path(__file__).parents[1]
COMMAND = re.compile(r"    (sweep|python) ")
CELLS, TOLERANCES = 32, (1e-4, 1e-8, 1e-12)
"""Of the work-precision pictures: small enough to be made while the site is built."""


def write(folder: Path) -> None:
    """Write all pages, those of before being replaced; pictures whose kernels have not changed are kept."""
    for name in ("kernels", "studies"):
        shutil.rmtree(folder / name, ignore_errors=True)
        (folder / name).mkdir(parents=True)
    (folder / "charts").mkdir(exist_ok=True)
    _put(folder / "kernels" / "index.md", _kernel_index())
    for name in catalogue.KERNELS:
        _put(folder / "kernels" / f"{name}.md", _kernel_page(name, _chart(name, folder / "charts")))
    for picture in sorted((ROOT / "studies").glob("*.png")):
        shutil.copy(picture, folder / "studies")
    _put(folder / "gallery.md", _gallery())
    _put(folder / "commands.md", _commands())


def _put(path: Path, lines: Iterable[str]) -> None:
    """Writes a page unless it is there already as it is, so that sphinx need not read it again."""
    text = "\n".join(lines) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


# kernels


def _kernel_index() -> Iterator[str]:
    yield from ("# What can be swept", "")
    yield from _table(("kernel", "scene", "methods, cheapest first"), map(_kernel_row, catalogue.KERNELS))
    yield from ("```{toctree}", ":hidden:", "", *catalogue.KERNELS, "```")


def _kernel_row(name: str) -> tuple[str, ...]:
    kernel = _kernel(name)
    return f"[`{name}`]({name}.md)", _plain(kernel.doc), ", ".join(f"`{method.name}`" for method in kernel.methods)


def _kernel(name: str) -> Kernel:
    module, _, entry = catalogue.KERNELS[name].partition(":")
    kernel: Kernel = getattr(import_module(module), entry)
    return kernel


def _kernel_page(name: str, chart: Path | None) -> Iterator[str]:
    kernel, module = _kernel(name), import_module(catalogue.KERNELS[name].partition(":")[0])
    yield from (f"# {name}", "", *prose(module.__doc__ or kernel.doc), "")
    yield from (f"Source: {_plain(kernel.source)}.", "") if kernel.source else ()
    yield from ("## Parameters", "")
    yield from _table(("name", "unit", "allowed", "default", "meaning"), map(_parameter, kernel.parameters))
    yield from ("## Outputs", "")
    yield from _table(("name", "unit", "meaning"), map(_output, kernel.outputs))
    yield from (
        "## Methods",
        "",
        "From the cheapest to the dearest; `auto` takes the first whose error bound meets `rtol`.",
        "",
    )
    yield from _table(("method", "how", "error", "cannot do"), map(_method, kernel.methods))
    yield from _picture(name, chart) if chart else ()
    yield from ("## Example of a study", "", "```toml", *starter(name).splitlines(), "```")


def _parameter(field: Field) -> tuple[str, ...]:
    return f"`{field.name}`", _unit(field), _plain(limits(field)), _default(field), _meaning(field)


def _output(field: Field) -> tuple[str, ...]:
    return f"`{field.name}`", _unit(field), _meaning(field)


def _method(method: Method) -> tuple[str, ...]:
    right = "`rtol`, or says by a status that it is not"
    stated = "a bound" if method.bound else "an estimate" if method.estimates else ""
    right = f"{stated}, stated per cell" if stated else right
    cannot = [*(f"`{name}`" for name in method.excludes), *(f"output `{name}`" for name in method.lacks)]
    return f"`{method.name}`", _plain(method.doc), right, ", ".join(cannot)


def _unit(field: Field) -> str:
    return "" if field.unit == "1" else f"`{field.unit}`"


def _default(field: Field) -> str:
    if field.default is None:
        return "required"
    words: dict[Any, str] = {number: word for word, number in field.choices.items()}
    text = words.get(field.default, field.default)
    return f"`{text}`" if isinstance(text, str) else f"{text:g}"


def _meaning(field: Field) -> str:
    return _plain(field.doc) + (f" (along {' and '.join(field.dims)})" if field.dims else "")


def _picture(name: str, chart: Path) -> Iterator[str]:
    yield from ("## Error against time", "", f"![Error against time per cell, {name}](../charts/{chart.name})", "")
    yield f"Each line is a method, each mark a tolerance of {', '.join(f'{t:g}' for t in TOLERANCES)}; {CELLS} cells"
    yield "of the study below, compared with the method that has the best bound. Times are those of the machine that"
    yield "built this site, and good for comparing methods alone; `sweep chart` draws the same of a study of your own."
    yield ""


def _chart(name: str, folder: Path) -> Path | None:
    """The work-precision picture of a kernel, made anew where a source of the kernels has changed."""
    path = folder / f"{name}-{_digest()}.png"
    if not path.exists():
        for old in folder.glob(f"{name}-*.png"):
            old.unlink()
        try:
            found = sweep.work_precision(_study(name), cells=CELLS, tolerances=TOLERANCES)
        except sweep.SweepError as reason:
            print(f"no picture of {name}: {reason}")
            return None
        sweep.plot(found, path, force=True)
    return path


def _study(name: str) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"{name}.toml")
        path.write_text(starter(name), encoding="utf-8")
        return sweep.study(path)


def _digest() -> str:
    """Of the sources of all kernels and of this page's settings."""
    files = sorted((ROOT / "kernels").rglob("*.py"))
    known = hashlib.sha256(repr((CELLS, TOLERANCES)).encode())
    for file in files:
        known.update(file.read_bytes())
    return known.hexdigest()[:12]


# studies


def _gallery() -> Iterator[str]:
    yield from ("# Studies", "", "Each is a question, answered by the commands below its picture.", "")
    for picture in sorted((ROOT / "studies").glob("*.png")):
        if picture.with_suffix(".py").exists():
            yield from _entry(picture.stem, picture.with_suffix(".py"))


def _entry(name: str, script: Path) -> Iterator[str]:
    """A study: the first line of its script asks, the caption of its picture answers, and the rest says how."""
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or name
    question, _, rest = re.sub(r"\\\n +", "", text).partition("\n")  # a command of two lines is one
    commands = [line for line in rest.splitlines() if COMMAND.match(line)]
    caption = script.with_suffix(".md").read_text(encoding="utf-8").strip()
    told = prose("\n".join(line for line in rest.splitlines() if line not in commands))
    yield from (f"## {name.replace('_', ' ')}", "", f"*{_plain(question)}*", "", f"![{name}](studies/{name}.png)", "")
    yield from (caption, "")
    for row in (ROOT / "docs" / "what_came_out.md").read_text(encoding="utf-8").splitlines():
        if row.startswith(f"| `{name}` |"):
            _, _, _, answer, checked, _ = row.replace("(theory/", "(../theory/").split("|")
            yield f"**What came out.** {answer.strip()} *How it was checked, and its limits:* {checked.strip()}"
    yield from ("", "```sh", *(re.split(r"  +", line.strip())[0] for line in commands), "```", "", *told, "")


# commands


def _commands() -> Iterator[str]:
    yield from ("# All commands", "", "`sweep COMMAND --help` prints the same.", "")
    for name, command in COMMANDS.items():
        yield from (f"## sweep {name}", "", *prose(inspect.cleandoc(command.function.__doc__ or "")), "")
        yield from _table(("argument", "what it does"), map(_option, command.options))


def _option(option: Option) -> tuple[str, ...]:
    metavar = option.keys.get("metavar") or ""
    words = metavar if isinstance(metavar, tuple) else (metavar,)
    return " ".join(f"`{text}`" for text in (*option.names, *words) if text), _plain(option.keys.get("help") or "")


# text


def prose(text: str) -> Iterator[str]:
    """A docstring as Markdown: what is indented are equations, as they stand; the rest are paragraphs."""
    for indented, lines in itertools.groupby(text.strip("\n").splitlines(), lambda line: line.startswith("    ")):
        if indented:
            yield from ("", "```text", *(re.sub(r" {5,}\(", "    (", line[4:]) for line in lines), "```", "")
        else:
            yield from map(_plain, lines)


def _plain(text: str) -> str:
    """Text of docstrings in which no letter means something to Markdown, but for code in back-quotes."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        part if part.startswith("`") else re.sub(r"([*_$<|\[\]~^])", r"\\\1", part) for part in parts
    ).replace("\n", " ")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|" + "---|" * len(head)
    for row in rows:
        yield f"| {' | '.join(row)} |"
    yield ""
