"""Cells, pairs and aggregates, against numbers worked out separately."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from conevo.campaigns.tables import RunValue
from conevo.report.comparison import (
    Cell,
    Group,
    Treatment,
    aggregate,
    compare_all,
    group_values,
    summarize,
    treatments_of,
)
from conevo.worlds.measures import Measure

CONE, MESP, HOM = Treatment("cone", ""), Treatment("mesp", ""), Treatment("homcne", "")


def value(
    environment, treatment, seed, reached, budget="smoke", optimum=None, larger_is_better=True
) -> RunValue:
    return RunValue(
        run=f"{environment}-{treatment.title}-{seed}",
        task=f"rover-v2/{environment}",
        world="rover-v2",
        environment=environment,
        family="complex",
        number=1,
        method=treatment.method,
        preset="smoke",
        variant=treatment.variant,
        seed=seed,
        budget=budget,
        measure=Measure("value", larger_is_better=larger_is_better),
        optimum=optimum,
        value=reached,
    )


def sample(mean: float, n: int = 12, seed: int = 0, sd: float = 1.0) -> list[float]:
    return np.random.default_rng(seed).normal(mean, sd, n).tolist()


def cells_of(
    samples: dict[tuple[str, Treatment], list[float]], **about
) -> dict[Cell, list[RunValue]]:
    return {
        Cell(*key): [value(*key, seed, one, **about) for seed, one in enumerate(reached)]
        for key, reached in samples.items()
    }


def test_runs_of_other_budgets_are_in_other_groups() -> None:
    values = [value("complex-1", CONE, 1, 2.0), value("complex-1", CONE, 2, 3.0, budget="night")]
    groups = group_values(values)
    assert list(groups) == [
        Group("rover-v2", "complex", "smoke"),
        Group("rover-v2", "complex", "night"),
    ]
    assert [len(of) for cells in groups.values() for of in cells.values()] == [1, 1]


def test_treatments_are_in_the_order_of_the_registry_then_by_level() -> None:
    found = [("own", ""), ("cone", "gst=0.2"), ("cone", "gst=0.1"), ("homcne", "gst=0.2")]
    assert [one.title for one in treatments_of(found)] == [
        "HomCNE, gst=0.2",
        "CONE, gst=0.1",
        "CONE, gst=0.2",
        "own",
    ]


def test_a_summary_has_mean_deviation_and_interval_of_the_runs() -> None:
    reached = sample(5.0)
    (one,) = map(summarize, cells_of({("complex-1", CONE): reached}).values())
    low, high = stats.t.interval(0.95, 11, np.mean(reached), stats.sem(reached))
    assert one.mean.value == pytest.approx(np.mean(reached))
    assert one.sd == pytest.approx(np.std(reached, ddof=1))
    assert (one.mean.low, one.mean.high) == pytest.approx((low, high))
    (single,) = map(summarize, cells_of({("complex-1", CONE): [3.0]}).values())
    assert (single.mean.value, single.sd, single.mean.low) == (3.0, None, None)


def test_every_pair_of_every_environment_is_corrected_together() -> None:
    samples = {
        (place, treatment): sample(mean, seed=7 * k + i)
        for k, place in enumerate(("complex-1", "complex-2"))
        for i, (treatment, mean) in enumerate([(HOM, 0.0), (MESP, 1.4), (CONE, 1.9)])
    }
    pairs = compare_all(cells_of(samples))
    assert [(pair.environment, pair.a, pair.b) for pair in pairs[:3]] == [
        ("complex-1", MESP, HOM),
        ("complex-1", CONE, HOM),
        ("complex-1", CONE, MESP),
    ]
    assert len(pairs) == 6
    assert {pair.n_tests for pair in pairs} == {6}
    ps = [
        stats.mannwhitneyu(
            samples[p.environment, p.a], samples[p.environment, p.b], method="exact"
        ).pvalue
        for p in pairs
    ]
    expected, worst = dict.fromkeys(range(6), 1.0), 0.0
    for rank, k in enumerate(sorted(range(6), key=ps.__getitem__)):
        worst = max(worst, (6 - rank) * ps[k])
        expected[k] = min(worst, 1.0)
    assert [pair.p_holm for pair in pairs] == pytest.approx(
        [expected[k] for k in range(6)], rel=1e-6
    )
    assert pairs[1].verdict == "better"


def test_pairs_that_differ_in_method_and_level_are_not_compared() -> None:
    low, high = Treatment("cone", "gst=0.1"), Treatment("cone", "gst=0.2")
    other = Treatment("mesp", "gst=0.1")
    samples = {("complex-1", one): sample(1.0, 4) for one in (low, high, other)}
    assert {frozenset((p.a, p.b)) for p in compare_all(cells_of(samples))} == {
        frozenset((low, high)),
        frozenset((low, other)),
    }


def test_a_factor_of_one_method_does_not_separate_it_from_the_others() -> None:
    low, high = Treatment("cone", "epochs=1, gst=0.1"), Treatment("cone", "epochs=1, gst=0.2")
    clones, more = Treatment("homcne", "epochs=1"), Treatment("homcne", "epochs=3")
    samples = {("complex-1", one): sample(1.0, 4) for one in (low, high, clones, more)}
    assert {frozenset((p.a, p.b)) for p in compare_all(cells_of(samples))} == {
        frozenset((low, high)),
        frozenset((low, clones)),
        frozenset((high, clones)),
        frozenset((clones, more)),
    }


def test_results_of_the_tests_are_separate_if_they_disagree() -> None:
    def verdict(a: list[float], b: list[float]) -> str:
        (pair,) = compare_all(cells_of({("complex-1", HOM): b, ("complex-1", CONE): a}))
        return pair.verdict

    assert verdict(sample(9.0), sample(5.0, seed=1)) == "better"
    assert verdict(sample(5.0, seed=1), sample(9.0)) == "worse"
    assert verdict([9.0, 9.1, 9.2], [5.0, 5.1, 5.2]) == "better (t-test only)"
    far = [1.0] * 9 + [-400.0]
    assert (
        verdict([0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05], far) == "better (ranks only)"
    )
    assert verdict(sample(100.0), sample(100.0, seed=1)) == "alike"
    assert verdict(sample(1.0, sd=3.0), sample(1.0, seed=1, sd=3.0)) == "undecided"


def test_the_smaller_of_two_is_better_if_the_world_declares_it() -> None:
    samples = {("complex-1", HOM): sample(9.0), ("complex-1", CONE): sample(5.0, seed=1)}
    (more,) = compare_all(cells_of(samples))
    (less,) = compare_all(cells_of(samples, larger_is_better=False))
    assert (more.verdict, less.verdict) == ("worse", "better")
    assert more.result == less.result
    assert less.gain == -more.gain == pytest.approx(4, abs=1)
    assert less.a12 == pytest.approx(1 - more.a12)
    first, second = (aggregate(cells_of(samples, larger_is_better=d))[1] for d in (True, False))
    assert first.iqm == second.iqm
    assert first.improvement[HOM].value == pytest.approx(1 - second.improvement[HOM].value)
    assert second.improvement[HOM].value > 0.95


def test_too_few_runs_are_distinguished_from_runs_that_differ_too_little() -> None:
    few = compare_all(cells_of({("complex-1", t): sample(m, 3) for t, m in ((HOM, 0), (CONE, 9))}))
    enough = compare_all(cells_of({("complex-1", t): sample(0, 4) for t in (HOM, CONE)}))
    three = compare_all(cells_of({("complex-1", t): sample(0, 4) for t in (HOM, MESP, CONE)}))
    assert three[0].too_few  # 3 x 2 / C(8, 4) = 0.086
    assert few[0].too_few  # 2 / C(6, 3) = 0.1
    assert not enough[0].too_few  # 2 / C(8, 4) = 0.029


def test_environments_are_pooled_as_shares_if_all_treatments_have_runs() -> None:
    cells = {
        Cell(place, treatment): [
            value(place, treatment, k, reached, optimum=optimum)
            for k, reached in enumerate(reached_by)
        ]
        for place, optimum, treatment, reached_by in [
            ("complex-1", 10.0, HOM, [1.0, 2.0, 3.0, 4.0]),
            ("complex-1", 10.0, CONE, [5.0, 6.0, 7.0, 8.0]),
            ("complex-2", 100.0, HOM, [10.0, 20.0, 30.0, 40.0]),
            ("complex-2", 100.0, CONE, [15.0, 25.0, 35.0, 45.0]),
            ("complex-3", 100.0, CONE, [99.0]),
        ]
    }
    hom, cone = aggregate(cells)
    assert (hom.treatment, cone.treatment) == (HOM, CONE)
    assert hom.environments == cone.environments == 2
    assert hom.iqm.value == pytest.approx(np.mean([0.2, 0.2, 0.3, 0.3]))
    assert cone.iqm.value == pytest.approx(np.mean([0.35, 0.45, 0.5, 0.6]))
    wins = [np.mean([a > b for a in x for b in y]) for x, y in (
        ([5, 6, 7, 8], [1, 2, 3, 4]), ([15, 25, 35, 45], [10, 20, 30, 40]))]  # fmt: skip
    assert cone.improvement[HOM].value == pytest.approx(np.mean(wins))
    assert hom.improvement == {}
