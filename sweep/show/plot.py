"""One picture of whatever is given: a result, a chart of error against time, or laws beside each other."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from sweep.errors import SweepError
from sweep.show.charts import precision_figure, result_figure, save
from sweep.show.law_charts import laws_figure
from sweep.words import require_dataset

if TYPE_CHECKING:
    import xarray as xr


def plot(
    dataset: xr.Dataset, path: str | os.PathLike[str] | None = None, *, y: str | None = None, x: str | None = None
) -> Any:
    """Picture of a result, of the chart that `work_precision` made, or of the laws that `compare_laws` tried.

    Of a result it shows one output: a line, a family of lines, or a map where there are two long axes. An axis is
    logarithmic where its grid is, or where the values span decades. Cells whose status is not OK are marked: on the
    line where they have a value, at the foot of the picture where they have none. Further axes are held at their
    middle value, which the title says.

    Parameters
    ----------
    dataset : Dataset
        From `run`, `open_result`, `work_precision` or `compare_laws`.
    path : path, optional
        Where to save it; .png, .svg or .pdf.
    y : str, optional
        Output of a result; by default the first, of a scene of one's own its `interval`.
    x : str, optional
        Axis of a result, or coordinate along the cells of a zip design. Default: what a trace runs along, else the
        longest.

    Raises
    ------
    SweepError
        If there is no such output or axis, or the file cannot be written.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> figure = sweep.plot(sweep.run(study), "period.png")
    >>> chart = sweep.plot(sweep.work_precision(study, methods=["closed", "asymptotic"], tolerances=[1e-6]))
    """
    require_dataset("plot", dataset)
    drawn = precision_figure if "reference" in dataset.attrs else laws_figure if "chosen" in dataset.attrs else None
    if drawn and (y or x):
        raise SweepError("y and x choose what is shown of a result; this Dataset has one picture, without them")
    figure = drawn(dataset) if drawn else result_figure(dataset, y, x)
    if path is not None:
        save(figure, path)
    return figure
