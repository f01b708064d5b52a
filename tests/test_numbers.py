"""Numbers, errors and time spans as every command and page shows them."""

from __future__ import annotations

import math

import pytest

from conevo.numbers import duration, number, plus_minus, short


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (math.nan, "-"),
        (math.inf, "-"),
        (0.0, "0"),
        (3.0, "3"),
        (0.123456, "0.1235"),
        (-0.5, "-0.5"),
        (-12.3456, "-12.35"),
        (4321.4, "4,321"),
        (1e6, "1,000,000"),
        (2.5e9, "2.5e+09"),
        (1234567, "1,234,567"),
    ],
)
def test_numbers_have_four_digits(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_number_may_have_a_given_number_of_decimals() -> None:
    texts = [number(value, 2, "none") for value in (1234.5, -0.001, 0.0, 20, None)]
    assert texts == ["1,234.50", "0.00", "0.00", "20", "none"]


def test_an_error_is_shown_with_two_digits() -> None:
    assert [plus_minus(0.0551, error) for error in (0.2, 0.0123, 0.006, None, 0.0)] == [
        "0.06 ± 0.20", "0.055 ± 0.012", "0.0551 ± 0.0060", "0.0551", "0.0551"
    ]  # fmt: skip
    assert plus_minus(0.5, 0.06, "+-") == "0.500 +- 0.060"
    assert plus_minus(0.0, 2.6e-16) == "0.00000 ± 0.00000"  # the error of rounding
    assert plus_minus(None, None) == "-"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59, "59 s"), (59.6, "1 min 00 s"), (245, "4 min 05 s"), (12000, "3 h 20 min")],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_thousands_are_short() -> None:
    assert [short(v) for v in (0, 0.25, 950, 20000, 1.5e6)] == ["0", "0.25", "950", "20k", "1.5M"]
