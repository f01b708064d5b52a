"""The environments of the multi-rover world are those of section 5.1 of the thesis."""

import pytest

from conevo.errors import UsageError
from conevo.worlds.rover.canals import load
from conevo.worlds.rover.rocks import ENVIRONMENTS, VALUES, Mix, layout, mix

FAMILIES = ("simple", "complex", "extended", "apart")  # the last is ours
VALUE_SHARES = (0.1, 0.2, 0.3, 0.4)  # of A..D at equal counts


def test_environments_are_four_sets_of_ten() -> None:
    expected = [f"{s}-{e}" for s in FAMILIES for e in range(1, 11)]
    assert list(ENVIRONMENTS) == expected


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_value_is_5000_and_every_rock_has_a_site(environment: str) -> None:
    counts = mix(environment)
    assert sum(n * v for n, v in zip(counts, VALUES, strict=True)) == 5000
    assert min(counts) >= 0
    assert sum(counts) <= load(layout(environment)).sum()


@pytest.mark.parametrize("e", range(1, 11))
def test_all_but_extended_use_their_own_layout_and_extended_the_last(e: int) -> None:
    assert mix(f"simple-{e}") == (0, 0, 0, 0, 5000)
    assert mix(f"complex-{e}") == (500, 500, 500, 500, 0)
    assert mix(f"extended-{e}").E == 0
    assert mix(f"apart-{e}") == mix(f"complex-{e}")
    assert [layout(f"{s}-{e}") for s in FAMILIES] == [e, e, 10, e]


def nearest_rocks(shares: list[float], counts: Mix) -> bool:
    """Whether every count is within one rock of its share of the value."""
    return all(
        abs(5000 * share / value - count) < 1
        for share, value, count in zip(shares, VALUES, counts, strict=False)
    )


@pytest.mark.parametrize("doubled", range(4))
def test_extended_2_to_5_double_one_value_share(doubled: int) -> None:
    rest = (1 - 2 * VALUE_SHARES[doubled]) / (1 - VALUE_SHARES[doubled])
    shares = [s * (2 if i == doubled else rest) for i, s in enumerate(VALUE_SHARES)]
    assert sum(shares) == pytest.approx(1)
    assert nearest_rocks(shares, mix(f"extended-{2 + doubled}"))


@pytest.mark.parametrize("absent", range(4))
def test_extended_6_to_9_leave_one_type_out(absent: int) -> None:
    rest = 1 / (1 - VALUE_SHARES[absent])
    shares = [0.0 if i == absent else s * rest for i, s in enumerate(VALUE_SHARES)]
    counts = mix(f"extended-{6 + absent}")
    assert counts[absent] == 0
    assert nearest_rocks(shares, counts)


def test_extended_1_is_equal_and_10_has_a_and_d_only() -> None:
    assert mix("extended-1") == (500, 500, 500, 500, 0)
    assert mix("extended-10") == (1000, 0, 0, 1000, 0)


def test_an_unknown_environment_names_the_nearest() -> None:
    with pytest.raises(UsageError, match="did you mean 'complex-1'"):
        mix("complx-1")
    with pytest.raises(UsageError, match="rover environment"):
        layout("simple-11")
