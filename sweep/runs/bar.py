"""A live bar in a notebook, by tqdm; elsewhere there is none."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any, TextIO


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


class Bar:
    """A bar of cells, drawn when there is something to show.

    Parameters
    ----------
    make : callable
        Makes what tqdm does.
    stream : text stream
        Beside it.
    name : str
        Of what is done.
    """

    def __init__(self, make: Callable[[], Any], stream: TextIO, name: str) -> None:
        self._make, self._stream, self._name = make, stream, name
        self._bar: Any = None

    def show(self, done: int, text: str) -> None:
        """Moves it to so many cells, with a text behind."""
        self._bar = self._bar or self._make()
        self._bar.set_description_str(f"{self._name}: {text}", refresh=False)
        self._bar.update(done - self._bar.n)

    def note(self, text: str) -> None:
        """Says something above it."""
        print(text, file=self._stream)

    def close(self) -> None:
        """Leaves it as it is."""
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()


def notebook_bar(stream: TextIO | None, name: str, total: int, done: int) -> Bar | None:
    """A bar where a run tells a notebook how far it is; None elsewhere, and where tqdm is not installed."""
    if stream is None or stream is not sys.stderr or not in_notebook():
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a notebook without widgets, which gets a bar of text
            from tqdm.auto import tqdm
    except ImportError:
        return None
    form = "{percentage:3.0f} %|{bar:20}| {desc}"
    keys = {"desc": name, "total": total, "initial": done, "bar_format": form, "mininterval": 0.5, "file": stream}
    return Bar(lambda: tqdm(**keys), stream, name)
