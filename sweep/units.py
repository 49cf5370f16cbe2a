"""Conversion of units: a number in a study is converted to the unit of the kernel's field.

Only this module imports pint, and only for units beyond a few everyday ones.
"""

from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from sweep.words import did_you_mean

DIMENSIONS = {
    "1": ("a plain number", '"1" or "percent"'),
    "rad": ("an angle", '"rad" or "degree"'),
    "rad/s": ("an angular frequency", '"rad/s" or "Hz"'),
    "rad/s^2": ("an angular acceleration", '"rad/s^2" or "degree/s^2"'),
    "Hz": ("a frequency", '"Hz" or "rad/s"'),
    "s": ("a time", '"s" or "ms"'),
    "1/s": ("a rate", '"1/s" or "1/minute"'),
    "1/s^2": ("a squared rate", '"1/s^2"'),
    "m": ("a length", '"m" or "mm"'),
    "m^2": ("an area", '"m^2" or "mm^2"'),
    "m^3": ("a volume", '"m^3" or "mm^3"'),
    "m/s": ("a speed", '"m/s" or "mm/s"'),
    "m/s^2": ("an acceleration", '"m/s^2"'),
    "kg": ("a mass", '"kg" or "g"'),
    "kg m^2": ("a moment of inertia", '"kg m^2" or "g cm^2"'),
    "N": ("a force", '"N" or "mN"'),
    "N m": ("a torque or an energy", '"N m" or "J"'),
    "N/m": ("a stiffness", '"N/m" or "N/mm"'),
    "N m/rad": ("an angular stiffness", '"N m/rad" or "N m/degree"'),
    "N m s/rad": ("an angular damping", '"N m s/rad"'),
    "Pa": ("a pressure", '"Pa" or "kPa"'),
    "W": ("a power", '"W" or "mW"'),
    "K": ("a temperature", '"K"'),
}
"""The quantity that a unit measures, and examples of units for it."""

KNOWN = {
    ("degree", "rad"): Decimal("0.01745329251994329576923690768"),
    ("ms", "s"): Decimal("0.001"),
    ("minute", "s"): Decimal(60),
    ("hour", "s"): Decimal(3600),
    ("mm", "m"): Decimal("0.001"),
    ("g", "kg"): Decimal("0.001"),
}
"""Factors that need no pint, whose import takes half as long as that of numba."""

COMMON = ("m", "mm", "cm", "kg", "g", "s", "ms", "minute", "hour", "day", "rad", "degree", "turn", "Hz", "kHz", "rpm")
"""Suggestions for misspelt units."""


class UnitMistake(ValueError):
    """The unit cannot be used here; the text says why and what to write."""


@cache
def scale(text: str, wanted: str, name: str) -> Decimal | None:
    """Factor from the unit `text` to the unit `wanted` of the field `name`; None where no conversion is needed.

    Leaving out "rad" is allowed; "Hz" counts full turns: 1 Hz = 2 pi rad/s.

    Raises
    ------
    UnitMistake
        The unit is unknown, has an offset, or measures something else.
    """
    if text == wanted:
        return None
    if (text, wanted) in KNOWN:
        return KNOWN[text, wanted]
    factor, given = _root(text)
    wanted_factor, needed = _root(wanted)
    if "radian" not in given and "radian" in needed:
        wanted_factor, needed = _root(wanted.replace("Hz", "s^-1"))
        needed = {base: power for base, power in needed.items() if base != "radian"}
    if given != needed:
        example = DIMENSIONS[wanted][1] if wanted in DIMENSIONS else f'"{wanted}"'
        raise UnitMistake(f'"{text}" is {_describe(text)}; {name} is {_describe(wanted)}, e.g. {example}')
    return factor / wanted_factor


def unit_of(value: Any) -> str:
    """The unit that numbers have themselves, as quantities of pint and astropy and a DataArray; "" of others."""
    return str(getattr(value, "units", getattr(value, "unit", "")))


def in_unit(value: Any, wanted: str, name: str) -> Any:
    """Numbers; those that have a unit themselves in the unit of the field `name`.

    Raises
    ------
    UnitMistake
        As of `scale`.
    TypeError
        They are complex.
    """
    if unit := unit_of(value):
        value = getattr(value, "magnitude", value) * float(scale(unit, wanted, name) or 1)
    if np.iscomplexobj(value):
        raise TypeError(f"{name} is complex")
    return np.ma.array(value, np.float64).filled(np.nan) if np.ma.isMaskedArray(value) else value


def measured(text: str, wanted: str, name: str) -> float:
    """The number in "0.1", or in "3 cm", converted to the unit `wanted` of the field `name`.

    Raises ValueError where it is no number, and UnitMistake as `scale`.
    """
    number, *unit = text.split(None, 1)
    factor = scale(unit[0].strip(), wanted, name) if unit else None
    return float((factor or 1) * Decimal(repr(float(number))))


def exponents(text: str) -> dict[str, Fraction]:
    """Powers of the base units in a unit, radian among them: {"radian": 1, "second": -2}. Raises UnitMistake."""
    return {base: Fraction(str(power)).limit_denominator(1000) for base, power in _root(text)[1].items()}


def _describe(text: str) -> str:
    """What a unit measures."""
    if text in DIMENSIONS:
        return DIMENSIONS[text][0]
    same = (words for unit, (words, _) in DIMENSIONS.items() if _root(unit)[1] == _root(text)[1])
    return next(same, f"of another kind ({_registry().parse_units(text)})")


def _root(text: str) -> tuple[Decimal, dict[str, Decimal]]:
    """Factor and exponents of `text` in root units, radian among them; "Hz" is a turn per second."""
    unit, registry = parsed(text), _registry()
    if "hertz" in str(unit):
        if not re.fullmatch(r"\w*hertz", str(unit)):
            raise UnitMistake(f'"{text}" has Hz inside a longer unit; write turns or radians, e.g. "turn/s^2"')
        unit = unit / registry.parse_units("hertz") * registry.parse_units("turn/second")
    try:
        zero, one = (registry.Quantity(Decimal(number), unit).to_root_units() for number in (0, 1))
    except Exception:  # of pint, and of what it calls, as for a logarithmic unit
        raise UnitMistake(f'"{text}" is not a multiple of other units; convert the numbers first') from None
    if zero.magnitude != 0:
        raise UnitMistake(f'"{text}" has an offset; give an absolute unit, e.g. "K"')
    return Decimal(one.magnitude), dict(one.unit_items())


@cache
def parsed(text: str) -> Any:
    """The unit as pint has it, which can be multiplied, and compared by its dimensionality. Raises UnitMistake."""
    from pint.errors import UndefinedUnitError

    example = 'write it like "rad/s^2" or "kg m^2"'
    try:
        if not re.fullmatch(r"[\w\s^*/().+°%-]*", text):
            raise ValueError  # pint would read "m;m" as m^2
        return _registry().parse_units("dimensionless" if text.strip() == "1" else text)
    except UndefinedUnitError as error:
        unknown = str(error.unit_names) if isinstance(error.unit_names, str) else str(next(iter(error.unit_names)))
        raise UnitMistake(f'"{unknown}" is not a known unit{did_you_mean(unknown, COMMON) or f"; {example}"}') from None
    except Exception:
        # pint's parser fails on malformed text in many ways (AssertionError, TokenError, TypeError, ValueError)
        raise UnitMistake(f'"{text}" cannot be read as a unit; {example}') from None


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)
