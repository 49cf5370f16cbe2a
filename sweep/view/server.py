"""Serves the page of a result on this machine."""

from __future__ import annotations

import os
import re
import socket
from pathlib import Path
from typing import Any

from sweep.errors import SweepError, missing
from sweep.file.open import open_result

ADDRESS = "127.0.0.1"
"""Nobody on another machine can reach it."""
OTHER_HOSTS = rf"(?!({re.escape(ADDRESS)}|localhost|\[::1\])$).*"
"""Names of this server that no browser of its user knows: a page from elsewhere asks for it by one of its own."""


def serve(path: str | os.PathLike[str], port: int = 0, show: bool = True) -> None:
    """Serve the page of a result until Ctrl-C; each window of a browser opens the result anew.

    Parameters
    ----------
    path : path
        The output of a sweep, finished or not.
    port : int
        Of this machine; 0: a free one.
    show : bool
        Open the page in the browser.

    Raises
    ------
    SweepError
        There is no result, it has nothing to look at, panel is not installed, or the port is taken.
    """
    try:
        import panel as pn
        from tornado.web import ErrorHandler

        from sweep.view.page import Page
    except ImportError:
        raise missing("the viewer needs panel", "view") from None
    result = Path(path)
    _check_free(port)
    with open_result(result) as dataset:
        Page(dataset, result.name)  # what cannot be shown is said here, not in the browser

    def session() -> Any:
        dataset = open_result(result)
        pn.state.on_session_destroyed(lambda _: dataset.close())
        return Page(dataset, result.name).layout

    server = pn.serve(session, port=port, address=ADDRESS, show=show, start=False, title=result.name, verbose=False)
    # pages and websockets alike, for tornado accepts any name in which Host and Origin agree
    server._tornado.add_handlers(OTHER_HOSTS, [(".*", ErrorHandler, {"status_code": 403})])
    print(f"http://{ADDRESS}:{server.port}/ shows {result}; Ctrl-C ends it", flush=True)
    server.run_until_shutdown()


def _check_free(port: int) -> None:
    """Raises SweepError where the page cannot be served at a port."""
    try:
        with socket.create_server((ADDRESS, port)):
            pass
    except (OSError, OverflowError) as error:
        raise SweepError(f"port {port} of this machine: {error}; choose another by --port, or none") from None
