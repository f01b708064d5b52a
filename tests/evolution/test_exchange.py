"""How populations start and exchange genes: each option against a small case worked by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, Trials, method

LAYOUT = Layout(n_robots=3, n_hidden=2, max_hidden=3, n_genes=4)
FOUR = Layout(n_robots=4, n_hidden=2, max_hidden=2, n_genes=4)


@pytest.mark.parametrize("name", ["ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3"])
def test_populations_may_start_as_copies_of_the_first(name: str) -> None:
    apart = method(name, genotypes=4).init(LAYOUT, root=5)
    alike = method(name, genotypes=4, common_start=True).init(LAYOUT, root=5)
    assert alike.genes.shape == apart.genes.shape
    for population in alike.genes:
        np.testing.assert_array_equal(population, apart.genes[0])
    assert len(np.unique(apart.genes[:, 0, 0, 0])) == 3
    assert len(np.unique(alike.genes[:, :2])) == 2 * 4 * 4  # slots, genotypes and genes differ
    np.testing.assert_array_equal(alike.active, apart.active)


def generation(learner: Any, state: Any, fitness: Any = 1.0, s: Any = 0.0, shares: Any = 0) -> Any:
    """Return the state after a generation in which all teams score alike.

    Args:
        learner: the method.
        state: at the beginning.
        fitness: of the robots, or a function of the trials.
        s: degree of specialization of the robots.
        shares: of their actions, [R, A]; none if 0.
    """
    end = state.generation + 1
    while state.generation < end:
        trials: Trials = learner.ask(state)
        n, r = trials.teams.shape[:2]
        credit = fitness(trials) if callable(fitness) else np.full((n, r), fitness)
        lives = np.broadcast_to(shares, (n, *np.shape(shares))) if np.ndim(shares) else None
        state = learner.tell(state, trials, Scores(credit, np.broadcast_to(s, (n, r)), lives))
    return state


def marked(learner: Any, layout: Layout, values: Any) -> Any:
    """Return generation 0 in which every gene of population p has its value, or of its slots."""
    state = learner.init(layout, root=5)
    own = np.asarray(values, np.float32).reshape(layout.n_robots, -1)
    genes = np.broadcast_to(own[:, :, None, None], state.genes.shape)
    return replace(state, genes=genes * state.active[:, :, None, None])


def families(state: Any, values: Any) -> list[set[int]]:
    """Return for each population the populations whose genes it has, by their values."""
    return [{values.index(value) for value in np.unique(genes)} for genes in state.genes]


NAMES = [1 / 8, 2 / 8, 3 / 8, 4 / 8]  # GD between populations i and j: |i - j| / 16


@pytest.mark.parametrize(
    ("name", "config", "expected"),
    [
        # SD: (0,2) and (1,3) 1/16; (1,2) 7/16; (0,1) and (2,3) 8/16; (0,3) 9/16.
        ("cone", {}, [{0, 2}, {1, 3}, {0, 2}, {1, 3}]),
        # All pairs are candidates. GD 1/16: (0,1), (1,2), (2,3), of which (1,2) has the least SD.
        ("cone", {"pairing": "all"}, [{0, 3}, {1, 2}, {1, 2}, {0, 3}]),
        # Without (0,1), (2,3), (0,3), whose SD is 1/2 and more, 0 and 3 have nobody left.
        ("cone", {"pairing": "all", "sst": 0.5}, [{0}, {1, 2}, {1, 2}, {3}]),
        ("cone-1", {"pairing": "all"}, [{0, 2}, {1, 3}, {0, 2}, {1, 3}]),  # SD alone
        ("cone-2", {}, [{0, 1}, {0, 1}, {2, 3}, {2, 3}]),  # GD alone, ties go to the first
    ],
)
def test_each_population_pairs_once_or_with_all_that_are_similar(
    name: str, config: dict[str, Any], expected: list[set[int]]
) -> None:
    learner = method(
        name, **{"genotypes": 4, "mutation_probability": 0.0, "gst": 1.0, "sst": 0.6} | config
    )
    state = generation(learner, marked(learner, FOUR, NAMES), s=[0, 1 / 2, 1 / 16, 9 / 16])
    assert families(state, NAMES) == expected


LIVES = [[1, 0], [0, 1], [0.75, 0.25], [0.25, 0.75]]  # 0 and 2 do the first action most


@pytest.mark.parametrize(
    ("sd", "s", "expected"),
    [
        ("switching", [0, 0, 0, 0], [{0, 1}, {0, 1}, {2, 3}, {2, 3}]),  # all alike
        ("shares", [0, 0, 0, 0], [{0, 2}, {1, 3}, {0, 2}, {1, 3}]),  # (0,2) and (1,3) 1/4
        ("shares", [0, 0, 0.5, 0.5], [{0, 2}, {1, 3}, {0, 2}, {1, 3}]),  # S does not matter
        ("entropy", [0, 1, 0, 1], [{0, 1}, {0, 1}, {2, 3}, {2, 3}]),  # 0 and 1 do one thing each
        ("label", [0, 0, 0.4, 0.4], [{0, 2}, {1, 3}, {0, 2}, {1, 3}]),
        ("label", [0, 0, 0.5, 0.4], [{0}, {1, 3}, {2}, {1, 3}]),  # 2 is not specialized
        ("label", [0, 0.5, 0.5, 0.5], [{0}, {1, 3}, {2}, {1, 3}]),  # neither 1 nor 3 is
    ],
)
def test_similar_behaviour(sd: str, s: list[float], expected: list[set[int]]) -> None:
    learner = method("cone", genotypes=4, mutation_probability=0.0, gst=1.0, sst=0.5, sd=sd)
    state = generation(learner, marked(learner, FOUR, NAMES), s=s, shares=LIVES)
    assert families(state, NAMES) == expected


@pytest.mark.parametrize(
    ("sd", "s", "sst"),
    [
        ("entropy", [0.5, 0.4, 0.3, 0.2], 0.47),  # entropy rises three times, whatever S does
        ("switching", [0.5, 0.4, 0.3, 0.2], 0.53),  # S falls
    ],
)
def test_sst_follows_the_measure_of_specialization(sd: str, s: list[float], sst: float) -> None:
    """While nothing progresses, a rise from specialists to generalists lowers SST."""
    learner = method("cone", genotypes=4, sd=sd, stagnation_v=1)
    state = learner.init(FOUR, root=5)
    for a, one in zip((0.0, 0.1, 0.2, 0.3), s, strict=True):
        state = generation(learner, state, s=one, shares=np.tile([1 - a, a], (4, 1)))
    assert round(state.sst, 6) == sst
    if sd == "entropy":  # of 0.7 and 0.3
        assert round(state.progress.numbers["activity_entropy"], 6) == 0.881291


@pytest.mark.parametrize("sd", ["shares", "label", "entropy"])
def test_shares_of_actions_must_be_known_if_pairing_depends_on_them(sd: str) -> None:
    learner = method("cone", genotypes=4, sd=sd)
    with pytest.raises(UsageError, match=f"method.sd = {sd!r} needs scores.shares"):
        generation(learner, learner.init(FOUR, root=5))


@pytest.mark.parametrize(
    ("slots", "gst", "recombinations"),
    # Population 0 has the values of population 1 in the other slot; slot by slot GD is 3/16.
    [("any", 0.1, 2), ("same", 0.1, 0), ("same", 0.1875, 0), ("same", 0.2, 2)],
)
def test_sub_populations_of_any_or_the_same_slot(
    slots: str, gst: float, recombinations: int
) -> None:
    learner = method("cone", genotypes=4, gst=gst, exchange_slots=slots)
    two = replace(LAYOUT, n_robots=2)
    state = marked(learner, two, [[1 / 8, 4 / 8, 0], [4 / 8, 1 / 8, 0]])
    state = generation(learner, state)
    assert state.progress.numbers["recombinations"] == recombinations


def test_a_share_of_the_pairs_exchanges_others_in_each_generation() -> None:
    ten = replace(LAYOUT, n_robots=10)  # 45 pairs of populations, all of them candidates

    def pairs(share: float, generation: int, root: int = 5) -> set[tuple[int, int]]:
        learner: Any = method("cone-2", genotypes=2, exchange_share=share)
        state = learner.init(ten, root)
        state = replace(state, progress=replace(state.progress, generation=generation))
        return {tuple(pair) for pair in learner.candidates(state).tolist()}

    assert pairs(0.0, 3) == set()
    assert len(pairs(1.0, 3)) == 45
    assert pairs(0.2, 3) < pairs(0.5, 3) < pairs(1.0, 3)
    assert pairs(0.5, 3) == pairs(0.5, 3)
    assert pairs(0.5, 3) not in (pairs(0.5, 4), pairs(0.5, 3, root=6))
    found = [pairs(0.2, generation) for generation in range(40)]
    assert sum(map(len, found)) / (45 * 40) == pytest.approx(0.2, abs=0.04)  # s.d. 0.0094
    assert set.union(*found) == pairs(1.0, 0)  # no pair is left out forever: 45 x 0.8^40 = 0.006


@pytest.mark.parametrize("name", ["cone", "cone-1", "cone-2"])
def test_without_a_share_of_the_pairs_nothing_is_exchanged(name: str) -> None:
    learner = method(name, genotypes=4, mutation_probability=0.0, gst=1.0, exchange_share=0.0)
    state = generation(learner, marked(learner, FOUR, NAMES))
    assert families(state, NAMES) == [{0}, {1}, {2}, {3}]
    assert state.progress.numbers["recombinations"] == 0


@pytest.mark.parametrize(
    ("name", "config", "words"),
    [
        ("cone-2", {"pairing": "all"}, "method.pairing = 'all': has no effect without the spec"),
        ("cone-2", {"sd": "shares"}, "method.sd = 'shares': has no effect without the spec"),
        ("cone", {"use_sdm": False, "sd": "label"}, "method.sd = 'label': has no effect without"),
        (
            "hom-es",
            {"signal": 0.9},
            "method.signal = 0.9: has no effect without the individual part",
        ),
        (
            "openai-es",
            {"share": 0.2},
            "method.share = 0.2: has no effect without method.team = rob",
        ),
        (
            "openai-es",
            {"optimiser": "momentum", "memory_squares": 0.5},
            "method.memory_squares = 0.5: has no effect without method.optimiser = adam",
        ),
        ("cone-3", {"pairing": "all"}, "method.pairing = 'all': has no effect without the spec"),
        ("cone-3", {"exchange_slots": "same"}, "method.exchange_slots = 'same': has no effect wi"),
        ("cone-3", {"exchange_share": 0.5}, "method.exchange_share = 0.5: has no effect without"),
        ("cone-3", {"thresholds_from": "ancestor"}, "method.thresholds_from = 'ancestor': has no"),
        ("cone", {"type_c": "off", "type_c_rounds": 3}, "method.type_c_rounds = 3: has no effect"),
        ("cone", {"exchange_share": 1.5}, "method.exchange_share = 1.5: must be less than or eq"),
        ("cone", {"sd": "caste"}, "method.sd = 'caste': must be 'switching', 'shares', 'label' or"),
    ],
)
def test_an_option_without_effect_is_refused(name: str, config: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError) as caught:
        method(name, **config)
    assert str(caught.value).startswith(words)


def test_an_option_that_a_variant_has_anyway_is_accepted() -> None:
    """CONE-1 recombines slot by slot; CONE-2 and CONE-3 have the defaults of options they lack."""
    assert method("cone-1", exchange_slots="same", exchange_share=0.5, pairing="all", sd="label")
    assert method("cone-2", exchange_slots="same", exchange_share=0.5, pairing="nearest")
    assert method("cone-3", exchange_slots="any", exchange_share=1.0, sd="switching")


THREE = NAMES[:3]


def worth(of_robot: Any, of_elites: Any = 0.0) -> Any:
    """Return a function that gives robots these credits, and others in type C's teams."""

    def credits_of(trials: Trials) -> Any:
        credit = of_elites if trials.purpose == "elites" else of_robot
        return np.broadcast_to(np.asarray(credit, float), trials.teams.shape[:2]).copy()

    return credits_of


@pytest.mark.parametrize(
    ("name", "config"),
    [("mesp", {}), ("cone", {"exchange_share": 0.0}), ("cone-3", {})],
)
def test_the_fittest_population_replaces_the_least_fit_at_intervals(
    name: str, config: dict[str, Any]
) -> None:
    learner = method(name, genotypes=4, mutation_probability=0.0, migration_every=2, **config)
    state = marked(learner, LAYOUT, THREE)
    active = state.active.copy()
    active[1] = True, False, True  # population 1 uses other slots
    genes = np.broadcast_to(np.array(THREE, np.float32)[:, None, None, None], state.genes.shape)
    state = replace(state, genes=genes * active[:, :, None, None], active=active)
    credit = worth([1, 5, 3], of_elites=[9, 1, 5])  # by type C it would be the other way round
    first = generation(learner, state, credit)
    assert first.population_fitness.tolist() == [1, 5, 3]
    assert first.progress.numbers["migrations"] == 0
    assert [set(np.unique(one)) - {0} for one in first.genes] == [{1 / 8}, {2 / 8}, {3 / 8}]
    second = generation(learner, first, credit)
    assert second.progress.numbers["migrations"] == 1
    assert [set(np.unique(one)) - {0} for one in second.genes] == [{2 / 8}, {2 / 8}, {3 / 8}]
    np.testing.assert_array_equal(second.genes[0], second.genes[1])
    if second.partners.size:
        np.testing.assert_array_equal(second.partners[0], second.partners[1])
    assert second.active.tolist() == [[True, False, True]] * 2 + [[True, True, False]]
    assert second.progress.n_hidden.tolist() == [2, 2, 2]
    assert second.watched_since.tolist() == [2, 0, 0]
    third = generation(learner, second, credit)
    assert third.progress.numbers["migrations"] == 0


def test_populations_are_compared_by_the_mean_of_their_finite_type_a_fitness() -> None:
    """Population 0 has the best genotype, population 1 the best mean, 2 no finite fitness."""
    learner = method("mesp", genotypes=2, mutation_probability=0.0, migration_every=1)
    state = marked(learner, LAYOUT, THREE)
    trials = learner.ask(state)  # of each slot of each population both genotypes: 12 teams
    credit = np.zeros((12, 3))
    credit[:4, 0] = 20, 0, -10, np.nan
    credit[4:8, 1] = 4, 4, 4, 5
    credit[8:, 2] = np.nan, np.inf, np.nan, -np.inf
    state = learner.tell(state, trials, Scores(credit, np.zeros((12, 3))))
    np.testing.assert_allclose(state.population_fitness, [10 / 3, 17 / 4, np.nan])
    assert learner.sources(state).tolist() == [0, 1, 1]
    for equal in ([2.0, 2.0, 2.0], [np.nan] * 3):
        same = replace(state, population_fitness=np.array(equal))
        assert learner.sources(same).tolist() == [0, 1, 2]
    one = replace(state, population_fitness=np.array([np.nan, np.nan, 2.0]))
    assert learner.sources(one).tolist() == [2, 1, 2]


def test_without_migration_its_other_settings_are_absent() -> None:
    learner = method("mesp", genotypes=4)
    state = generation(learner, learner.init(LAYOUT, root=5), worth([1, 5, 3]))
    assert "migrations" not in state.progress.numbers
    with pytest.raises(UsageError, match=r"method.migration_every = 3 needs several populations"):
        method("cone", migration_every=3).init(replace(LAYOUT, n_robots=1), root=5)
