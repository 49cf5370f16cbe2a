"""Bits of what every method of every kernel gives on columns of cells that are the same on every machine.

python tests/helpers/golden_columns.py [KERNEL ...]            what differs from tests/golden/digests.json
python tests/helpers/golden_columns.py --targets [KERNEL ...]  the same of code compiled for generic, AVX2 and AVX-512
python tests/helpers/golden_columns.py --write [KERNEL ...]    writes the file anew, or what it has of these kernels

Cells are near the kernel's example, within a factor of four of it, wild (parameters over 60 powers of two, with zeros,
limits, the smallest and largest float64, infinities and NaN), and those of `SPECIAL`. Each has an rtol of its own. The
file holds statuses and values themselves, compressed, so that a difference can be told by its cells and its size.
"""

import argparse
import base64
import json
import math
import os
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import rich_scene
import sliding_scene
from columns import bounds, called, checked, columns_of

from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

sys.path.append(str(Path(__file__).parents[2] / "studies"))
import lag_scene

FILE = Path(__file__).parents[1] / "golden" / "digests.json"
RTOLS = (1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
SCENES = {"rich": rich_scene.RICH, "lag": lag_scene.KERNEL, "sliding": sliding_scene.SLIDING}
"""Scenes of one's own: with every kind of term, stiff, and sliding along a kink."""
OF_SCENE = {"lag": ("taylor", "rodas5p"), "sliding": ("taylor", "dop853", "rodas5p")}
"""Methods of a scene whose bits are kept, where the others' are kept of its neighbours."""
NEAR, USUAL, WILD = 0, 4, 60
MANY, FEW = {NEAR: 43, USUAL: 43, WILD: 44}, {NEAR: 33, USUAL: 8, WILD: 6}
"""{powers of two that a parameter is spread over: cells}, of kernels and of scenes of one's own, which take longer."""
LENGTHS = {"drivetrain": (1, 2, 4, 9), "drivetrain_frf": (1, 2, 8)}
"""Of array parameters."""
SMALL = {
    "foliot_noise": {"half_swings": 40.0, "averaging_time": 20.0, "sigma": 0.01},
    "foliot_steps": {"flips": 2.0},
    "polisher_wear_point": {"tau": 1.0},
    "sliding": {"flips": 4.0},
    "lag": {"flips": 4.0},
    "rich": {"flips": 6.0},
}
"""Examples that take less time."""
FAR = {"radius": 0.3, "frequency": 20.0}
"""How far coordinates without a limit are looked at."""
PITCH = 0.0060805
CLOCKS = (
    (4.0, 0.05, 0.2), (2.0, 0.1, 0.0), (0.21, 0.048, 0.277), (20.4555, 0.1277, 0.5778), (12.7859, 0.1057, 0.5342),
    (17.13985716032627, 0.004964693289814581, 0.6716857730988353), (1.0, 0.02, 0.35), (1e13, 0.05, 0.2),
)  # fmt: skip
FLAT = ((62.01, 38.0, 40.5, 16.49), (1.0, 1.0, 1.0, 1.0), (7.0, 4.0, 3.0, 0.0), (62.0, 60.0, 5.0, 10.0))
FLAT += ((10.0, 38.0, 40.5, 15.0), (62.0, 38.0, 40.0, 16.0), (1e300, 1e300, 1e300, 1e299), (1.0, 0.6, 0.7, 1e-40))
LINKS = tuple(dict(zip("bdfe", lengths, strict=True)) for lengths in FLAT)
BALANCES = ({"r": 0.0, "r_s": 0.0}, {"zeta": 1.0}, {"zeta": 0.0, "r": 0.25, "theta0": 1.0}, {"omega_n": 1e-308})
SPECIAL = {
    "foliot": ({"a": 0.0}, {"a": 0.0, "c": 0.5, "n": 1.5}, {"a": 0.0, "R": 0.9}, {"k": 0.99}, {"a": 1e-9}, {"a": 1e30}),
    "foliot_design": ({"amplitude": 0.5}, {"period": 1e-300}),
    "foliot_noise": ({"half_swings": 2.0}, {"a": 0.0}, {"mu": 1e-300}),
    "foliot_start": ({"phi_start": 2.0}, {"phi_start": -1.0}, {"a": 0.0, "R": 0.5}, {"a": 0.0}, {"R": 2.0}),
    "balance": BALANCES,
    "balance_trace": BALANCES,
    "balance_driven": (
        {"zeta": 0.0},
        {"zeta": 0.0, "r": 0.1},
        {"zeta": 1.5},
        {"w": 1e-8, "r": 0.1},
        {"omega_n": 1e-308},
    ),
    "impact": ({"torque": 0.0}, *({"I_c": 1e-5 * kappa, "h": eta * PITCH, "e": e} for kappa, eta, e in CLOCKS)),
    "polisher": LINKS,
    "polisher_motion": LINKS,
    "polisher_wear": ({"preston": 1e-300, "pressure": 1e-300}, {"e": 0.3}, {"b": 2.0}, {"b": 0.1, "e": 0.15}),
}
"""Cells with statuses that neither usual nor wild ones have: what differs from the example."""
TARGETS = {
    "generic": ("generic", ""),
    "AVX2": ("haswell", "+avx,+avx2,+fma,+bmi,+bmi2"),
    "AVX-512": ("skylake-avx512", "+avx,+avx2,+fma,+bmi,+bmi2,+avx512f,+avx512dq,+avx512vl,+avx512bw,+avx512cd"),
}
"""numba's names of processors, and what they can."""
PLAIN = {
    "polisher": 3,
    "drivetrain": 3,
    "polisher_wear": 1,
    "polisher_wear_point": 2,
    "foliot_ripple": 2,
    "foliot_steps": 1,
    "foliot_noise": 4,
    "verge": (30, 55, 65),
}
"""Cells of each method that are computed in plain Python: how many, or which ones, where others take a minute; 8 of
other kernels, one of scenes of one's own."""
ONCE = {"sdirk4": 1, "map": 5, "dopri5": 4}
"""The same of methods that take thousands of steps in some of their cells."""
THOUSANDS = {"sdirk4"}
"""Methods that take them in all."""
TO_THE_LIMIT = {"sliding": (40, 41, 42, 45), "rich": (34, 45)}
"""Cells in which a method goes on for seconds until it has taken as many steps as it may."""


class Numbers:
    """Random numbers of which numpy keeps every bit the same in all its versions, and no library's pow is asked."""

    def __init__(self):
        self._raw = np.random.PCG64(11).random_raw

    def share(self, shape):
        return (self._raw(math.prod(shape)) >> np.uint64(11)).reshape(shape) * 2.0**-53

    def whole(self, count, shape):
        return np.floor(count * self.share(shape)).astype(int)


def kernel_of(name):
    """A kernel of the catalogue, or a scene of `SCENES`."""
    return SCENES[name] if name in SCENES else catalogue.get(name)


def example_of(name):
    return {**kernel_of(name).example, **SMALL.get(name, {})}


def _column(field, typical, shape, columns, numbers, spread):
    """Values of a parameter; at its default in half of the cells where the example does without it.

    Parameters
    ----------
    spread : 0: within an eighth of the example, or below 0.3 where it has none; else over so many powers of two
    """
    share, word = numbers.share(shape), numbers.whole(len(field.choices) or 2, shape)
    on = numbers.share(shape) < 0.5
    if field.choices:
        return np.array(list(field.choices.values()), float)[word]
    if isinstance(typical, str):
        with np.errstate(over="ignore"):
            return columns[typical] * np.ldexp(1.0, word)
    given = np.any(typical)
    scale = np.asarray(typical, float) if given else 1.0
    if field.integer:
        values = np.floor(scale * (0.5 + share)) + word
    elif spread:
        values = scale * np.ldexp(1.0 + share, numbers.whole(spread, shape) - spread // 2)
    else:
        values = scale * (0.875 + 0.25 * share) if given else 0.3 * share
    if not given:
        values = np.where(on, values, field.default or 0.0)
    low = np.nextafter(field.lower, 1.0) if field.open_lower else field.lower
    values = np.clip(np.where(on | (field.lower >= 0.0) | (spread < WILD), values, -values), low, field.upper)
    if spread == WILD and not field.integer:
        ends = np.array([0.0, field.lower, field.upper, 5e-324, 1e-300, 1e300, np.finfo(float).max, math.inf, math.nan])
        values = np.where(numbers.share(shape) < 0.03, ends[numbers.whole(ends.size, shape)], values)
    return values * np.ones(shape)


def _cells(name, count, length, numbers, spread):
    """{parameter: column}."""
    example, columns = example_of(name), {}
    for field in kernel_of(name).parameters:
        typical = example.get(field.name, field.default)
        if field.dims and np.ndim(typical):
            typical = np.resize(typical, length)
        columns[field.name] = _column(field, typical, (count, *(length for _ in field.dims)), columns, numbers, spread)
    return columns


def cell_of(name, **changed):
    """{parameter: column} of one cell: the example with these changes."""
    kernel = kernel_of(name)
    columns = columns_of(kernel, (), {key: [value] for key, value in (example_of(name) | changed).items()})
    return {field.name: column for field, column in zip(kernel.parameters, columns, strict=True)}


def inputs(name, length=1):
    """{parameter: column} of near, usual, wild and special cells, and their rtol."""
    numbers = Numbers()
    counts = FEW if name in SCENES else MANY
    cells = [_cells(name, count, length, numbers, spread) for spread, count in counts.items()]
    cells += [cell_of(name, **changed) for changed in SPECIAL.get(name, ())]
    columns = {key: np.concatenate([part[key] for part in cells]) for key in cells[0]}
    return columns, np.resize(RTOLS, len(next(iter(columns.values()))))


def along_of(kernel):
    """A few values of each coordinate."""
    return [
        np.arange(max(f.lower, 0.0), max(f.lower, 0.0) + 5.0)
        if f.integer
        else np.linspace(max(f.lower, 0.0), f.upper if np.isfinite(f.upper) else FAR[f.name], 7)
        for f in kernel.along
    ]


def check_of(kernel, columns):
    """The status that `check` gives every cell."""
    return checked(kernel, *columns.values())


def solved(kernel, method, columns, rtol, along=None):
    """{what: column} of a method: outputs, NaN where the cell is refused, the error it estimates, status and bound."""
    along, columns = along_of(kernel) if along is None else along, list(columns.values())
    found, status, error = called(kernel, method.name, columns, rtol, along, None)
    found |= {"error": np.where(status >= FIRST_REFUSAL, np.nan, error)} if method.estimates else {}
    bound = {} if method.bound is None else {"bound": bounds(kernel, method.name, *columns, rtol=rtol, along=along)}
    return found | {"status": status} | bound


def taken(columns, rows):
    """The cells of these rows."""
    return {key: np.ascontiguousarray(column[rows]) for key, column in columns.items()}


def cases(names):
    """(name, name in the file, kernel, columns, rtol) of each kernel, and of each length of its arrays."""
    for name in names:
        for length in LENGTHS.get(name, (1,)):
            yield name, name if length == 1 else f"{name} {length}", kernel_of(name), *inputs(name, length)


def _kept(array):
    return base64.b64encode(zlib.compress(array.tobytes(), 9)).decode()


def _read(text, like):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), like.dtype).reshape(-1, *like.shape[1:])


def _bits(array):
    """As integers; every NaN is the same NaN."""
    return (
        np.where(np.isnan(array), np.nan, array).view(np.int64) if array.dtype.kind == "f" else array.astype(np.int64)
    )


def difference(found, kept):
    """None where the bits are equal, else how many cells differ and how far."""
    if len(kept) < len(found) or found.shape[1:] != kept.shape[1:]:
        return f"{len(found)} cells, where {len(kept)} are kept"
    here, there = _bits(found), _bits(kept)
    cells = (here != there).any(axis=tuple(range(1, here.ndim)))
    if not cells.any():
        return None
    first = int(np.flatnonzero(cells)[0])
    text = f"{cells.sum()} of {cells.size} cells differ, the first is {first}: "
    if found.dtype.kind != "f":
        return text + f"{found[first]} instead of {kept[first]}"
    numbers = np.isfinite(found) & np.isfinite(kept) & (here != there)
    ulps = np.abs(here - there)[numbers].max(initial=0)
    place = (first, *(np.argwhere(here[first] != there[first])[0] if found.ndim > 1 else ()))
    lost = (np.isfinite(found) != np.isfinite(kept)).any(axis=tuple(range(1, found.ndim))).sum()
    return text + f"{found[place]!r} instead of {kept[place]!r}; at most {ulps} ulp; a number in one alone: {lost}"


def chosen(name, count):
    """Numbers of the cells that are computed: all, or in plain Python as many as that does in a moment."""
    few = PLAIN.get(name, 1 if name in SCENES else 8)
    if COMPILED:
        return np.arange(count)
    return np.array(few) if isinstance(few, tuple) else np.unique(np.linspace(0, count - 1, few).astype(int))[:count]


def computed(name, kernel, columns, rtol, few=1):
    """(what, its column, cells among those that are sound) of the check and of each method; None: of all cells.

    Parameters
    ----------
    few : if not 1: of the methods of `THOUSANDS` every so manyth cell only, and none of those of `TO_THE_LIMIT`
    """
    status = check_of(kernel, columns)
    yield "check", status, None
    sound = np.flatnonzero(status == Status.OK)
    left_out = TO_THE_LIMIT.get(name, ()) if few > 1 else ()
    for method in map(kernel.method, OF_SCENE.get(name, [m.name for m in kernel.methods])):
        cells = chosen(name, sound.size)[: None if COMPILED else ONCE.get(method.name)]
        cells = np.setdiff1d(cells[:: few if method.name in THOUSANDS else 1], left_out)
        own = sound[cells]
        for what, values in solved(kernel, method, taken(columns, own), rtol[own]).items():
            yield f"{method.name} {what}", values, cells


def differences(names, few=1):
    """A line for every output whose bits are not those kept: kernel, method and output, how many cells, how far."""
    golden = json.loads(FILE.read_text(encoding="utf-8"))
    for name, case, kernel, columns, rtol in cases(names):
        kept, seen = golden.get(case, {}), set()
        for what, values, cells in computed(name, kernel, columns, rtol, few):
            seen.add(what)
            if what not in kept:
                yield f"{case}: {what}: not in {FILE.name}"
                continue
            old = _read(kept[what], values)
            told = difference(values, old if cells is None or cells.max(initial=0) >= len(old) else old[cells])
            if told:
                yield f"{case}: {what}: {told}"
        yield from (f"{case}: {what}: in {FILE.name} only" for what in kept if what not in seen)


def write(names):
    """Writes the file anew."""
    found = {}
    for name, case, kernel, columns, rtol in cases(names):
        found[case] = {what: _kept(values) for what, values, _ in computed(name, kernel, columns, rtol)}
    known = {case for _, case, *_ in cases([*catalogue.KERNELS, *SCENES])}
    kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    golden = {case: outputs for case, outputs in sorted((kept | found).items()) if case in known}
    FILE.write_text(json.dumps(golden, indent=0) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kernels", nargs="*", metavar="KERNEL")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--targets", action="store_true")
    options = parser.parse_args()
    names = options.kernels or [*catalogue.KERNELS, *SCENES]
    if options.write:
        return write(names)
    if options.targets:
        codes = []
        for target, (cpu, features) in TARGETS.items():
            print(f"{target}:", flush=True)
            environment = {**os.environ, "NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": features}
            codes.append(subprocess.run([sys.executable, __file__, *names], env=environment, check=False).returncode)
        sys.exit(max(codes))
    told = list(differences(names))
    print("\n".join(told) or f"the bits of {len(names)} kernels are those of {FILE.name}")
    sys.exit(1 if told else 0)


if __name__ == "__main__":
    main()
