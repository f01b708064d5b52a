"""The tables that compare the levels of a factor, by hand."""

import math
import sys
from pathlib import Path

import pytest
from scipy.stats import t

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "experiments"))  # scripts import what they share

from compare_levels import comparison_table, groups, main, pooled_table, signal_table  # noqa: E402
from conevo.errors import UsageError  # noqa: E402
from pages import write  # noqa: E402
from rotations import OTHER, SAME, orders, rotation_table  # noqa: E402


def row(method, seed, value, **levels):
    """Return a run."""
    cost = {"evaluations": 100, "team_steps": 100, "core_seconds": 1.0, "exchanges": 0.0}
    facts = {"seed": seed, "value": value, "first": 1.0, "icc": None, "reliability": None}
    return {"task": "rover-v2/complex-5", "method": method, **levels, **facts, **cost}


CREDIT = [
    row(method, seed, value + seed, credit=credit)
    for method, credit, value in (
        ("ccga", "equation", 100.0), ("ccga", "value", 120.0),
        ("mesp", "equation", 50.0), ("mesp", "value", 40.0),
    )
    for seed in (1, 2)
]  # fmt: skip


def lines(text):
    """Return the cells of a table's rows."""
    rows = [line for line in text.splitlines() if line.startswith("| ")][1:]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in rows]


def test_a_level_is_compared_with_the_baseline_if_all_else_agrees():
    ccga, mesp = lines(comparison_table(CREDIT, "credit", "equation"))
    assert ccga[:6] == ["CCGA", "value", "2, 2", "102 (1)", "122 (1)", "+20"]
    assert mesp[:6] == ["Multi-Agent ESP", "value", "2, 2", "52 (1)", "42 (1)", "−10"]
    assert (ccga[7], ccga[9]) == ("+19.7 %", "2 of 2")
    assert (mesp[7], mesp[9]) == ("−19.4 %", "0 of 2")


def test_cells_are_pooled_as_shares_of_their_baselines():
    """CCGA +20 of 101.5, Multi-Agent ESP -10 of 51.5; each mean of two has the variance 1/4;

    that of a baseline counts times the square of the ratio.
    """
    whole, ccga, mesp = lines(pooled_table(CREDIT, "credit", "equation"))
    shares = (20 / 101.5, -10 / 51.5)
    assert whole[:4] == ["value", "all", "2", f"{100 * sum(shares) / 2:+.1f} %"]
    assert ccga[1:4] == ["CCGA", "1", f"{100 * shares[0]:+.1f} %"]
    assert mesp[1:4] == ["Multi-Agent ESP", "1", f"−{-100 * shares[1]:.1f} %"]
    own = [0.25 / (2 * base) ** 2 for base in (101.5, 51.5)]
    variances = own + [(1 + share) ** 2 * v for share, v in zip(shares, own, strict=True)]
    freedom = sum(variances) ** 2 / sum(v**2 for v in variances)
    reach = t.ppf(0.975, freedom) * math.sqrt(sum(variances))
    low, high = (100 * (sum(shares) / 2 + sign * reach) for sign in (-1, 1))
    assert whole[4] == f"−{-low:.1f} % to {high:+.1f} %"


def test_levels_missing_in_the_baseline_are_named():
    rows = [row("mesp", 1, 10.0, places="mixed"), row("mesp", 1, 20.0, places="apart")]
    rows += [row("cone", 1, 30.0, places="apart", exchange=one) for one in ("some", "all")]
    found = list(groups(rows, "method", "mesp"))
    assert [(at["places"], rest) for at, rest, _, _ in found] == [
        ("apart", "CONE, some"),
        ("apart", "CONE, all"),
    ]
    assert all([one["value"] for one in same] == [20.0] for _, _, _, same in found)


def test_a_missing_level_is_one_line():
    with pytest.raises(UsageError, match=r"no run has credit=vaule; levels: equation, value"):
        list(groups(CREDIT, "credit", "vaule"))


def test_signal_is_a_mean_over_runs():
    rows = [one | {"icc": 0.1 * one["seed"], "reliability": 0.5} for one in CREDIT]
    assert lines(signal_table(rows))[0] == ["CCGA", "equation", "2", "0.1500", "0.500"]


def test_places_of_the_same_region_and_of_others_are_distinguished():
    assert (SAME, OTHER) == ((4, 8, 12), (1, 2, 3))
    rows = [
        {"method": "cone-es", "seed": 1, "own": 100.0, "same region": 90.0, "other region": 20.0},
        {"method": "cone-es", "seed": 2, "own": 200.0, "same region": 220.0, "other region": 20.0},
    ]
    expected = ["CONE-ES", "2", "150", "100 % (90 to 110)", "15 % (10 to 20)"]
    assert lines(rotation_table(rows)) == [expected]


def test_two_regions_are_swapped_and_the_others_left_alone():
    """Robots 0 to 7 start in A, B, C, D, A, B, C, D."""
    changed = orders(8)
    assert changed["A and C"][0].tolist() == [2, 1, 0, 3, 6, 5, 4, 7]
    assert changed["B and D"][0].tolist() == [0, 3, 2, 1, 4, 7, 6, 5]
    assert len(changed) == 3 + 6
    regions = [order % 4 for order in changed["same region"]]
    assert all(one.tolist() == [0, 1, 2, 3] * 2 for one in regions)


def test_a_page_is_made_again_from_its_numbers(tmp_path):
    page = tmp_path / "credit.md"
    page.write_text("# Page\n\n<!-- credit=equation -->\n<!-- end -->\n")
    write(CREDIT, page.with_suffix(".csv"))
    main(["--again", "--baseline", "credit=equation", "--write", str(page)])
    assert lines(page.read_text()) == lines(comparison_table(CREDIT, "credit", "equation"))
