"""The format of numbers, and tables as CSV and LaTeX."""

from __future__ import annotations

import math

import pytest

from conevo.report.exhibits import (
    Column,
    Table,
    interval,
    number,
    p_value,
    plain,
    slug,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (math.nan, "–"), (0.0, "0"), (20, "20"), (1234567, "1,234,567"),
     (0.01234, "0.012"), (1.239, "1.24"), (123.45, "123.5"), (49848.7, "49,849"), (-0.5, "-0.500")],
)  # fmt: skip
def test_numbers_have_about_four_digits(value, text) -> None:
    assert number(value) == text


def test_a_probability_is_never_written_as_zero() -> None:
    assert [p_value(p) for p in (0.0, 0.0009, 0.049, None)] == ["<0.001", "<0.001", "0.049", "–"]


def test_an_interval_needs_both_ends() -> None:
    assert interval((1.0, 2.5)) == "1.00 to 2.50"
    assert interval((None, 2.5)) == interval(None) == "–"


def table(rows: int = 2) -> Table:
    columns = [Column("name", "name", plain), Column("p", "p & q", p_value),
               Column("ends", "95 % interval", interval)]  # fmt: skip
    made = [{"name": f"a_{k}", "p": 1 / 3, "ends": (0.5, None), "more": k} for k in range(rows)]
    return Table("own", "A table", "n: runs; p < 0.05, ±1", columns, made)


def test_csv_has_all_numbers_unrounded_and_pairs_in_two_columns() -> None:
    lines = table().to_csv().splitlines()
    assert lines[0] == "name,p,ends_low,ends_high,more"
    assert lines[1] == "a_0,0.3333333333,0.5,,0"


def test_a_column_has_the_same_decimals_unless_sizes_are_far_apart() -> None:
    def texts(*values: object) -> list[str]:
        return Column("x", "x").texts(values)

    assert texts(0.98, 1.02, 1.1, 0.0, None) == ["0.98", "1.02", "1.10", "0.00", "–"]
    assert texts(0.012, 0.5, 1234.0) == ["0.012", "0.500", "1,234"]
    assert texts(0.0123, 1.5, 2.5) == ["0.012", "1.50", "2.50"]
    assert texts(-0.001, 0.95) == ["-0.001", "0.950"]
    assert Column("x", "x", interval).texts([(0.9, 1.2), (1.0, None), (9.0, 11.0)]) == [
        "0.90 to 1.20", "–", "9.00 to 11.00"
    ]  # fmt: skip


def test_names_of_files_are_plain() -> None:
    assert slug("rover-v2, complex: smoke") == "rover-v2-complex-smoke"
