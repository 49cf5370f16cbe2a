"""Columns of cells that stick on a kink, followed along it (`sliding`); what rests there for ever sticks as before."""

import contextlib
import functools
from dataclasses import replace

import numpy as np

from kernels.codegen.record import record
from kernels.codegen.stepped import twice_by
from kernels.interface import Status
from kernels.source_text.expression import SceneError

SLIDERS = {"taylor": ("dop853", "rodas5p")}
"""Methods by which a method follows what slides along a kink, where that is not itself."""


def slid_along(how, scene, method):
    """The function of columns `how`, whose cells that stick are followed from their start by methods that slide.

    A cell goes to the next method where one finds no end of its slide; with none left it STICKS.
    Powers of abs(u) are followed to u = 0 by the Taylor method alone (`integrate.powers`); their scenes stay so, and
    those in which a kink is a surface too.
    """
    recorded = record(scene)
    graph = recorded.graph
    if graph.powers or recorded.shared or len(graph.kinks) == len(recorded.surfaces):
        return how
    ways = [twice_by(one, sliding(scene)) for one in SLIDERS.get(method, (method,))]

    def solve(module, columns, rtol, outputs, status):
        how(module, columns, rtol, outputs, status)
        for slid in ways:
            cells = np.flatnonzero(status == Status.STICKS)
            if len(cells):
                found, verdict = np.full((len(outputs), len(cells)), np.nan), np.empty(len(cells), np.int8)
                slid(module, [c[cells] for c in columns], rtol[cells], list(found), verdict)
                for column, values in zip((*outputs, status), (*found, verdict), strict=True):
                    column[cells] = values

    return solve


@functools.cache
def sliding(scene):
    """The scene that slides, for all methods; recorded at once as the scene is, or refused where it is asked for."""
    scene = replace(scene, slides=True)
    with contextlib.suppress(SceneError):
        record(scene)
    return scene
