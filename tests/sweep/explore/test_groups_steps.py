"""Groups from weights given by hand, what is advised, and how far points lie off one curve."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from sweep.explore import groups
from sweep.explore.groups import Group, Scaling


class Weights:
    """Scalings by what each field is multiplied by, in powers of the leading ones."""

    def __init__(self, leading, **weights):
        self.leading, self.known = leading, {name: [F(w) for w in row] for name, row in weights.items()}

    def weights(self, name):
        return self.known[name]


def test_a_group_is_what_does_not_scale_and_like_parameters_are_divided():
    found = Weights(("a", "b"), a=(1, 0), b=(0, 1), c=(2, -1), d=(2, -1), e=("1/2", 0))
    names = ["a", "b", "c", "d", "e"]
    told = [str(group) for group in groups._groups(names, ["a", "b"], found)]
    assert told == ["b c/a^2", "d/c", "e^2/a"]
    assert [str(g) for g in groups._groups(["d", "a", "b"], ["a", "b"], found)] == ["d b/a^2"]


@pytest.mark.parametrize(
    ("powers", "whole"),
    [
        ((F(1), F(1, 2)), (2, 1)),
        ((F(1), F(-3, 4)), (4, -3)),
        ((F(1), F(1, 5)), (1, F(1, 5))),
        ((F(1, 2), F(1, 3)), (F(1, 2), F(1, 3))),
        ((F(1), F(2)), (1, 2)),
    ],
)
def test_powers_are_made_whole_where_that_takes_four_at_most(powers, whole):
    assert tuple(groups._whole(dict(zip("ab", powers, strict=True))).values()) == whole


def test_an_output_is_scaled_by_leading_parameters_alone():
    found = Weights(("a", "b"), out=(1, -2), odd=(0, 1), plain=(0, 0))
    assert str(groups._scale("out", ["a", "b"], found)) == "b^2/a"
    assert groups._scale("odd", ["a"], found) is None
    assert groups._scale("plain", ["a"], found) == Group(())


@pytest.mark.parametrize(
    ("powers", "text"),
    [
        ({}, ""),
        ({"a": 1, "b": 2}, "a b^2"),
        ({"a": 1, "b": -1}, "a/b"),
        ({"a": -2, "b": -1}, "1/(a^2 b)"),
        ({"a": F(-1, 2)}, "1/a^(1/2)"),
        ({"a": F(3, 2), "b": -1}, "a^(3/2)/b"),
    ],
)
def test_groups_as_texts(powers, text):
    assert str(Group(tuple((name, F(p)) for name, p in powers.items()))) == text


def test_an_output_times_a_group_reads_as_a_product_or_a_share():
    assert groups._product("period", Group((("a", F(1)),))) == "period a"
    assert groups._product("period", Group((("a", F(-1)),))) == "period/a"
    assert groups._product("period", Group((("a", F(-1)), ("b", F(1))))) == "period b/a"
    assert groups._product("period", Group(())) == "period"


def test_the_value_of_a_group():
    group = Group((("a", F(1, 2)), ("b", F(-2))))
    assert group.of({"a": 16.0, "b": 2.0}) == 1.0


MU_A = Group((("mu", F(1)), ("a", F(-2))))
C_D = Group((("c", F(1)), ("d", F(-1))))


@pytest.mark.parametrize(
    ("changed", "advice"),
    [
        ({"free": 0}, ""),
        (
            {},
            "one-dimensional in mu, a: only mu/a^2 matters; 1 of these axes can be left out; "
            "tried on 9 cells at random",
        ),
        (
            {"axes": ("mu", "a", "c"), "groups": (MU_A, C_D), "hidden": 2},
            "2-dimensional in mu, a, c: only mu/a^2, c/d matter; 1 of these axes can be left out; tried on 9 cells at "
            "random; 2 of the scalings used do not follow from declared units",
        ),
        (
            {"groups": (C_D,), "others": ("n", "k")},
            "one-dimensional in mu, a for each n, k: 1 of these axes can be left out; tried on 9 cells at random",
        ),
        (
            {"free": 2},
            "every output is a power of mu, a times a constant; a single cell tells all; tried on 9 cells at random",
        ),
        (
            {"free": 2, "others": ("n",)},
            "every output is a power of mu, a times a constant; a single cell tells all for each n; tried on 9 cells "
            "at random",
        ),
    ],
)  # fmt: skip
def test_advice_word_for_word(changed, advice):
    plain = Scaling(groups=(MU_A,), scales={}, axes=("mu", "a"), free=1, tried=9)
    assert replace(plain, **changed).advice == advice
