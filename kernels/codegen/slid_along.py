"""Columns of cells that stick on a kink, followed along it (`sliding`); what rests there for ever sticks as before."""

from dataclasses import replace

import numpy as np

from kernels.codegen.record import record
from kernels.codegen.stepped import twice_by
from kernels.interface import Status


def slid_along(how, scene, methods):
    """The function of columns `how`, whose cells that stick are followed from their start by these methods, that slide.

    A cell goes to the next method where one finds no end of its slide; with none left it STICKS.
    Powers of abs(u) are followed to u = 0 by the Taylor method alone (`integrate.powers`); their scenes stay so, and
    those in which a kink is a surface too.
    """
    recorded = record(scene)
    graph = recorded.graph
    if graph.powers or recorded.shared or len(graph.kinks) == len(recorded.surfaces):
        return how
    sliding = replace(scene, slides=True)
    ways = [twice_by(method, sliding) for method in methods]

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
