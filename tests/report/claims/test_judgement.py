"""The rules of verdicts, one by one, for a claim with few cells."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import pytest

from conevo.report.claims.evidence import Evidence, RunOf
from conevo.report.claims.judgement import judge
from conevo.report.claims.outcomes import Decision
from conevo.report.claims.statements import Claim
from conevo.report.claims.vocabulary import part_of
from conevo.report.statistics import compare, holm

PLACES = tuple(f"complex-{n}" for n in range(1, 11))
Samples = dict[tuple[str, str], Sequence[float]]


def around(mean: float, sd: float = 0.03, n: int = 20) -> list[float]:
    """Return n quantiles of a normal distribution; the deviation is a share of the mean."""
    return [mean * (1 + sd * NormalDist().inv_cdf((k + 0.5) / n)) for k in range(n)]


def evidence(
    samples: Samples, quantity: str = "value", budgets: dict[tuple[str, str], str] | None = None
) -> Evidence:
    """Return runs with these values, seeds from 1."""
    values, runs = {}, {}
    for key, sample in samples.items():
        budget = (budgets or {}).get(key, "smoke")
        runs[key] = [RunOf(f"{key}-{k}", k, budget) for k in range(1, len(sample) + 1)]
        values |= {one.run: value for one, value in zip(runs[key], sample, strict=True)}
    return Evidence("rover-v2", "smoke", "", {quantity: values}.__getitem__, runs)


def claim(*rows: str) -> Claim:
    return Claim("R0", "something", "5.5", tuple(map(part_of, rows)))


CONE_ABOVE = claim("above | value | cone : mesp | complex-1")
CONE_ALIKE = claim("alike | value | cone : mesp | complex-1")
HERE = "complex-1"


def two(cone: Sequence[float], mesp: Sequence[float]) -> Evidence:
    return evidence({(HERE, "cone"): cone, (HERE, "mesp"): mesp})


@pytest.mark.parametrize(
    ("cone", "above_mesp", "alike_to_mesp"),
    [
        (around(110), "reproduced", "not reproduced"),
        (around(90), "not reproduced", "not reproduced"),
        (around(100), "not reproduced", "reproduced"),  # shown to be alike
        (around(100, sd=0.6), "undecided: n too small", "undecided: n too small"),
        (around(110)[:1], "undecided: n too small", "undecided: n too small"),
        ([], "undecided: 0 of 1 environments", "undecided: 0 of 1 environments"),
    ],
)
def test_above_and_alike(cone: list[float], above_mesp: str, alike_to_mesp: str) -> None:
    runs = two(cone, around(100))
    if not cone:
        del runs.runs[HERE, "cone"]
        above_mesp = alike_to_mesp = "undecided: no such runs"
    assert judge(CONE_ABOVE, runs).verdict == above_mesp
    assert judge(CONE_ALIKE, runs).verdict == alike_to_mesp


def test_zeros_are_not_alike() -> None:
    assert judge(CONE_ALIKE, two([0.0] * 20, [0.0] * 20)).verdict == "undecided: all values are 0"
    assert judge(CONE_ABOVE, two([0.0] * 20, [0.0] * 20)).verdict == "undecided: all values are 0"


def test_if_the_tests_disagree_both_are_reported() -> None:
    # One run far below: means differ little, ranks a lot.
    cone, mesp = [*around(110, n=19), -500.0], around(100)
    found = compare(cone, mesp)
    assert found.p_t is not None
    assert found.p_mann_whitney is not None
    assert found.p_mann_whitney < 0.05 < found.p_t
    verdict = judge(CONE_ABOVE, two(cone, mesp))
    assert verdict.verdict == "undecided: the tests disagree"
    assert ("t-test: undecided: n too small; Mann-Whitney with Holm: reproduced") in verdict.why


def test_holm_is_over_all_comparisons_of_the_claim() -> None:
    # p = 0.02 by ranks: enough by itself, not in a family of ten.
    cone, mesp = around(104, 0.05, 20), around(100, 0.05, 20)
    alone = judge(CONE_ABOVE, two(cone, mesp))
    p = compare(cone, mesp).p_mann_whitney
    assert p is not None
    assert 0.005 < p < 0.05
    assert alone.verdict == "reproduced"
    ten = {(place, name): v for place in PLACES for name, v in (("cone", cone), ("mesp", mesp))}
    together = judge(claim("above | value | cone : mesp | complex-1..10"), evidence(ten))
    assert [cell.p_holm for cell in together.cells] == holm([p] * 10)
    assert together.verdict == "undecided: the tests disagree"
    assert together.tests == "t-test; Mann-Whitney with Holm over 10"
    assert "t-test: reproduced; Mann-Whitney with Holm: undecided: n too small" in together.why


def test_a_cell_is_decided_by_its_own_test_alone() -> None:
    # A difference that Holm removes does not rule out "alike"; the t-test still does.
    cone, mesp = around(104, 0.05, 20), around(100, 0.05, 20)
    ten = {(place, name): v for place in PLACES for name, v in (("cone", cone), ("mesp", mesp))}
    found = judge(claim("alike | value | cone : mesp | complex-1..10"), evidence(ten))
    assert {cell.by_rank for cell in found.cells} == {Decision.HOLDS}
    assert {cell.by_t for cell in found.cells} == {Decision.CONTRADICTED}


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ([100] * 10, "reproduced"),
        ([100] * 9 + [150], "reproduced"),  # nine of ten are enough
        ([100] * 8 + [150] * 2, "not reproduced"),
        ([100] * 9, "reproduced"),  # whatever the tenth would be
        ([100] * 8, "undecided: 8 of 10 environments"),
        ([100] * 8 + [150], "undecided: 9 of 10 environments"),
        ([150] * 2, "not reproduced"),  # the eight missing ones cannot change it
    ],
)
def test_nine_of_ten_environments(levels: list[float], expected: str) -> None:
    samples: Samples = {}
    for place, level in zip(PLACES, levels, strict=False):
        samples[place, "mesp"], samples[place, "ccga"] = around(100), around(level)
    nine = claim("alike | value | ccga : mesp | complex-1..10 | need 9")
    assert judge(nine, evidence(samples)).verdict == expected


def test_an_environment_counts_only_with_all_its_pairs() -> None:
    both = claim("above | value | cone : mesp, ccga | complex-1..2 | need 1")
    samples = {(HERE, name): around(100) for name in ("mesp", "ccga")}
    samples |= {(HERE, "cone"): around(150)}
    assert judge(both, evidence(samples)).verdict == "reproduced"
    samples[HERE, "ccga"] = around(150, sd=0.8)
    assert judge(both, evidence(samples)).verdict == "undecided: n too small"
    samples[HERE, "ccga"] = around(200)
    assert judge(both, evidence(samples)).verdict == "undecided: 1 of 2 environments"


def test_all_parts_must_be_true() -> None:
    samples = {
        (HERE, "cone"): around(150),
        (HERE, "mesp"): around(100),
        (HERE, "ccga"): around(100),
    }
    better = "above | value | cone : mesp | complex-1"
    same = "alike | value | mesp : ccga | complex-1"
    other = "alike | value | mesp : cone | complex-1"
    assert judge(claim(better, same), evidence(samples)).verdict == "reproduced"
    assert judge(claim(better, same, other), evidence(samples)).verdict == "not reproduced"


@pytest.mark.parametrize(
    ("seen", "n", "expected"),
    [
        (160, 200, "reproduced"),
        (16, 20, "undecided: n too small"),  # 56 to 94 %
        (130, 200, "undecided: n too small"),  # 58 to 72 %: reaches into 70 to 90 %
        (100, 200, "not reproduced"),
        (200, 200, "not reproduced"),
    ],
)
def test_shares_need_their_whole_interval_inside(seen: int, n: int, expected: str) -> None:
    runs = evidence({(HERE, "cone"): [1.0] * seen + [0.0] * (n - seen)}, "entrapment")
    found = judge(claim("within | entrapment | cone | complex-1 | 0.7..0.9"), runs)
    assert found.verdict == expected
    assert found.tests == "Clopper-Pearson interval"
    assert found.effect == f"{HERE}: entrapment, CONE = {seen / n:.2f}, claimed 0.70 to 0.90"


def test_a_mean_over_environments_is_taken_seed_by_seed() -> None:
    # Stages of a shaping: seeds differ, but each does as well in both environments.
    levels = around(0.7, sd=0.2, n=8)
    place = "share of the optimum"
    samples: Samples = {
        ("complex-1", "cone"): [x + 0.1 for x in levels],
        ("complex-2", "cone"): [x - 0.1 for x in levels[:-1]],  # the last seed failed here
    }
    pooled = claim(f"within | {place} | cone | {{complex-1..2}} | 0.5..0.9")
    found = judge(pooled, evidence(samples, place))
    (cell,) = found.cells
    assert cell.gathered.samples == (pytest.approx(levels[:-1]),)
    assert found.n == "7"
    assert found.tests == "Student's t interval"
    samples.pop(("complex-2", "cone"))
    missing = judge(pooled, evidence(samples, place))
    assert missing.verdict == "undecided: 1 of 2 environments"
    assert missing.why == "0 of 1 hold; 1 without all their runs; no runs of CONE in complex-2"


def test_pooled_runs_are_undecided_until_all_environments_have_runs() -> None:
    samples = {(place, "cone"): [0.0] * 20 for place in PLACES[:9]}
    pooled = claim("within | entrapment | cone | {complex-1..10} | 0.7..0.9")
    assert (
        judge(pooled, evidence(samples, "entrapment")).verdict == "undecided: 9 of 10 environments"
    )
    samples[PLACES[9], "cone"] = [0.0] * 20
    assert judge(pooled, evidence(samples, "entrapment")).verdict == "not reproduced"


def test_budgets_are_never_mixed_in_an_environment() -> None:
    samples = {(HERE, "cone"): around(150), (HERE, "mesp"): around(100)}
    apart = evidence(samples, budgets={(HERE, "mesp"): "twice as much"})
    found = judge(CONE_ABOVE, apart)
    assert found.verdict == "undecided: no runs of equal budgets"
    assert found.n == "0"
    assert "no runs of equal budgets in complex-1" in found.why


def test_environments_may_be_compared_across_budgets() -> None:
    # Complex environments are learned in stages, simple ones are not (6.4.2).
    samples = {("complex-1", "cone"): around(150), ("simple-1", "cone"): around(100)}
    pair = claim("above | value | cone | complex-1 ~ simple-1")
    found = judge(pair, evidence(samples, budgets={("complex-1", "cone"): "stage"}))
    assert found.verdict == "reproduced"
    assert found.budget == "smoke; stage"
    assert found.effect.startswith("complex-1 - simple-1: value, CONE = +50 (+33%)")


def test_the_effect_is_that_of_the_cell_on_which_the_verdict_depends() -> None:
    samples: Samples = {(place, "mesp"): around(100) for place in PLACES[:3]}
    samples |= {("complex-1", "cone"): around(200), ("complex-3", "cone"): around(120)}
    three = claim("above | value | cone : mesp | complex-1..3")
    held = judge(three, evidence(samples | {("complex-2", "cone"): around(140)}))
    assert held.effect == "complex-3: value, CONE - MESP = +20 (+17%) (weakest of 3)"
    found = compare(around(120), around(100))
    assert (held.low, held.high) == (found.low, found.high)
    wrong = judge(three, evidence(samples | {("complex-2", "cone"): around(50)}))
    assert wrong.effect.startswith("complex-2: value, CONE - MESP = -50 (-50%)")
    assert wrong.why == "2 of 3 hold; 1 contradicted (complex-2 value, CONE - MESP)"


def test_too_few_runs_are_reported() -> None:
    def few(n: int) -> str:
        samples = {(HERE, "cone"): around(150, n=n), (HERE, "mesp"): around(100, n=n)}
        return judge(CONE_ABOVE, evidence(samples)).why

    assert "none of 1 Mann-Whitney tests can become significant" in few(3)  # 0.1 at best
    assert "Mann-Whitney" not in few(4)  # 0.029 at best


def test_the_weakest_cell_is_found_by_its_interval() -> None:
    samples: Samples = {(place, "mesp"): around(100) for place in PLACES[:2]}
    samples |= {(PLACES[0], "cone"): around(120), (PLACES[1], "cone"): around(130, sd=0.25)}
    runs = claim("above | value | cone : mesp | complex-1..2")
    assert judge(runs, evidence(samples)).effect.startswith("complex-2")  # larger, but less certain
    shares: Samples = {(place, "cone"): [1.0] * 20 for place in PLACES[:3]}
    shares[PLACES[1], "cone"] = [1.0] * 17 + [0.0] * 3
    most = claim("has | one caste | cone | complex-1..3")
    found = judge(most, evidence(shares, "one caste"))
    assert found.verdict == "reproduced"
    assert found.effect == (
        "complex-2: one caste, CONE = 0.85, claimed 0.50 to 1.00 (weakest of 3)"
    )


def test_a_true_part_does_not_decide_an_open_one() -> None:
    samples = {(HERE, "cone"): around(150), (HERE, "mesp"): around(100, 0.6)}
    samples[HERE, "ccga"] = around(100, 0.6)
    better = "above | value | cone : mesp | complex-1"
    same = "alike | value | mesp : ccga | complex-1"
    assert judge(claim(better), evidence(samples)).verdict == "reproduced"
    assert judge(claim(better, same), evidence(samples)).verdict == "undecided: n too small"
