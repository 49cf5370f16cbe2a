"""Beads on a rod, in plain numpy: a kernel with array parameters, to test the engine with. Named "beads:KERNEL".

total = sum of mass;  moment_i = mass_i place_i;  share_i = mass_i / total, read from the last bead to the first
"""

import numpy as np

from kernels.interface import Field, Kernel, Method, Status


def check(mass, place, g, status):
    good = np.isfinite(place).all(axis=1) & (mass > 0).all(axis=1) & (g > 0)
    status[...] = np.where(good, Status.OK, Status.BAD_INPUT)


def quick(mass, place, g, rtol, total, moment, share, status):
    total[...] = mass.sum(axis=1)
    moment[...] = mass * place * g[:, None]
    share[...] = np.nan
    status[...] = Status.OK


def whole(mass, place, g, rtol, total, moment, share, status):
    quick(mass, place, g, rtol, total, moment, share, status)
    share[...] = (mass / total[:, None])[:, ::-1]


KERNEL = Kernel(
    name="beads",
    doc="Beads on a rod.",
    source="statics",
    parameters=(
        Field("mass", "kg", "mass", dims=("bead",), lower=0, open_lower=True),
        Field("place", "m", "distance from the pivot", default=0.5, dims=("bead",)),
        Field("g", "m/s^2", "acceleration of free fall", default=9.80665, lower=0, open_lower=True),
    ),
    outputs=(
        Field("total", "kg", "mass of all beads"),
        Field("moment", "N m", "moment of each bead", dims=("bead",)),
        Field("share", "1", "share of each bead, from the last one", dims=("turned",)),
    ),
    check=check,
    methods=(Method("quick", "no shares", quick, lacks=("share",)), Method("whole", "everything", whole)),
    same_length={"turned": "bead"},
    example={"mass": (0.1, 0.2, 0.3)},
)
