"""CONE-ES on made-up fitness: each part of a generation against a calculation by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from conevo.evolution import Layout, Scores, Trials, method
from conevo.evolution.inheritance import breed_from
from conevo.evolution.methods.cone_es import FIRST, ConeEsState, _signal
from conevo.evolution.strategies import centred_ranks

LAYOUT = Layout(n_robots=6, n_hidden=3, max_hidden=4, n_genes=5)
UPHILL = np.random.default_rng(2).standard_normal((4, 5))  # of a linear fitness, [U, G]

Credit = Callable[[Trials], np.ndarray]  # [N, R]


def worth(trials: Trials) -> np.ndarray:
    """Fitness [N, R], linear in each robot's genes."""
    return (trials.networks() * UPHILL).sum(axis=(2, 3))


def luck(trials: Trials) -> np.ndarray:
    """Credits [N, R] that do not depend on genes."""
    rng = np.random.default_rng([trials.generation, len(trials.teams)])
    return rng.standard_normal(trials.teams.shape[:2])


def told(learner: Any, state: ConeEsState, credit: np.ndarray) -> ConeEsState:
    """Return the state after these credits [N, R]."""
    found: ConeEsState = learner.tell(
        state, learner.ask(state), Scores(credit, np.zeros(credit.shape))
    )
    return found


def evolved(learner: Any, state: ConeEsState, credit: Credit, generations: int) -> ConeEsState:
    """Return the state after a number of generations."""
    end = state.progress.generation + generations
    while state.progress.generation < end:
        state = told(learner, state, credit(learner.ask(state)))
    return state


def around(learner: Any, team: np.ndarray | float = 0.0) -> ConeEsState:
    """Return a state around a team [R, U, G], of which three of four slots are in use."""
    active = np.arange(4) < 3
    genes = np.broadcast_to(np.float32(team), (6, 4, 5)) * active[:, None]
    state: Any = breed_from(learner, LAYOUT, 3, genes.astype(np.float32), np.tile(active, (6, 1)))
    return state


def rms(genes: np.ndarray) -> float:
    """Root mean square of genes [..., U, G] in the three slots in use."""
    return float(np.sqrt((genes[..., :3, :] ** 2).mean()))


def same(a: ConeEsState, b: ConeEsState, *but: str) -> None:
    """Check that two states agree bit for bit, except in some fields."""
    for field in fields(ConeEsState):
        if field.name not in ("progress", *but):
            np.testing.assert_array_equal(
                getattr(a, field.name), getattr(b, field.name), err_msg=field.name
            )


# --- teams and ranks ------------------------------------------------------------------------------


def test_pairs_are_mirror_images_in_the_scenarios_of_their_round() -> None:
    learner = method("cone-es", pairs=20, rounds=4, individual=0.4)
    team = np.random.default_rng(1).uniform(-0.3, 0.3, (6, 4, 5))
    state = around(learner, team)
    trials = learner.ask(state)
    assert (trials.rounds, trials.scenarios, trials.purpose) == (4, "fresh", "pairs")
    rounds = trials.networks().reshape(4, 2, 5, 6, 4, 5)  # [K, mirror, pairs, R, U, G]
    centre = state.mean + state.deviations
    np.testing.assert_allclose(
        rounds.mean(axis=1), np.broadcast_to(centre, (4, 5, 6, 4, 5)), atol=1e-6
    )
    moves = rounds[:, 0] - centre
    alike = np.ptp(moves, axis=2).max(axis=(2, 3)) < 1e-6  # [K, pairs]: in all robots of a team
    assert alike.tolist() == [[False, False, True, True, True]] * 4  # a share of 0.4 is individual
    assert not np.isclose(moves[:, :, 0, :3], moves[::-1, ::-1, 0, :3]).any()
    shared, both = rms(moves[:, 2:]), rms(moves[:, :2])
    assert shared == pytest.approx(0.1, rel=0.1)
    assert both == pytest.approx(0.1 * 2**0.5, rel=0.1)
    assert not moves[..., 3, :].any()


def test_ranks_of_each_robot_by_hand() -> None:
    fitness = np.array([[3.0, 1.0], [1.0, 2.0], [1.0, np.inf], [np.nan, 4.0], [9.0, 3.0]])
    expected = [[0.25, -0.25], [-0.125, 0.0], [-0.125, -0.5], [-0.5, 0.5], [0.5, 0.25]]
    assert centred_ranks(fitness).tolist() == expected
    assert centred_ranks(np.full((3, 1), np.nan)).tolist() == [[0.0]] * 3


def test_teams_are_ranked_in_their_round_alone() -> None:
    """A round with lucky scenarios counts no more and no less than another."""
    learner = method("cone-es", pairs=20, rounds=4)
    state = around(learner)
    credit = worth(learner.ask(state))
    lucky = np.repeat([0.0, 1000.0, -50.0, 3.0], 10)[:, None]
    same(told(learner, state, credit), told(learner, state, credit + lucky))


def test_a_team_that_is_not_finite_ranks_last() -> None:
    learner = method("cone-es", pairs=10, rounds=2)
    state = around(learner)
    credit = worth(learner.ask(state))
    least, spoiled = credit.copy(), credit.copy()
    least[3] = least[12] = -1e9
    spoiled[3], spoiled[12] = np.nan, -np.inf
    after = told(learner, state, spoiled)
    same(after, told(learner, state, least))
    assert after.progress.n_nonfinite == 12
    assert np.isfinite(after.progress.mean_fitness)
    one = credit.copy()
    one[3, 2] = np.inf  # of one robot: the team is last, too; the credit of the other robots counts
    least[:] = credit
    least[3, 2] = -1e9
    same(told(learner, state, one), told(learner, state, least))


def test_nothing_moves_if_nothing_is_finite() -> None:
    learner = method("cone-es", pairs=10)
    state = evolved(learner, around(learner, 0.3), lambda t: luck(t) * np.nan, 8)
    np.testing.assert_array_equal(state.mean[:3], np.float32(0.3))
    assert not state.deviations.any()
    assert np.isnan(state.progress.best_fitness)


# --- the shared part ------------------------------------------------------------------------------


def test_the_first_mean_is_the_fittest_of_random_controllers() -> None:
    learner = method("cone-es", pairs=30)
    first: Any = learner.init(LAYOUT, 5)
    trials = learner.ask(first)
    assert trials.teams.shape[0] == 60
    networks = trials.networks()
    assert (networks == networks[:, :1]).all()  # clones
    assert np.unique(networks[:, 0, 0, 0]).size == 60
    values = worth(trials)[:, 0]
    state = told(learner, first, worth(trials))
    again = learner.ask(state)  # the best fifth, in each of five rounds
    assert (len(again.teams), again.rounds) == (60, 5)
    best = np.argsort(-values, kind="stable")[:12]
    tried = again.networks()[:, 0].reshape(5, 12, *networks.shape[2:])
    np.testing.assert_array_equal(tried, np.broadcast_to(networks[best, 0], tried.shape))
    luckier = worth(again)
    luckier[[7, 19, 31, 43, 55]] += 100.0  # the eighth, in every round
    luckier[3] += 400.0  # the fourth, in one of them
    np.testing.assert_array_equal(told(learner, state, luckier).mean, networks[best[7], 0])
    state = told(learner, state, worth(again))
    np.testing.assert_array_equal(state.mean, networks[values.argmax(), 0])
    assert len(learner.ask(state).teams) == 1


@pytest.mark.parametrize("name", ["cone-es", "hom-es"])
def test_the_mean_steps_uphill_by_the_right_distance(name: str) -> None:
    learner = method(name, step=0.03, pairs=60)
    before = around(learner)
    after = evolved(learner, before, worth, 1)
    step = (after.mean - before.mean).astype(float)
    assert rms(step) == pytest.approx(0.03, rel=1e-5)
    assert not step[3].any()
    up = UPHILL[:3] / rms(UPHILL)
    assert (step[:3] / 0.03 * up).mean() > 0.8  # the cosine of the angle between them
    later = evolved(learner, after, worth, 5)
    assert worth(learner.ask(later)).mean() > worth(learner.ask(after)).mean()


def test_genes_stay_in_range() -> None:
    learner = method("cone-es", step=0.5, individual_step=0.5, pairs=10)
    state = evolved(learner, around(learner, 0.8), worth, 12)
    genes = np.abs(state.mean + state.deviations)
    assert genes.max() == pytest.approx(1, abs=1e-6)
    assert (genes > 0.999).mean() > 0.3
    assert not genes[:, 3].any()
    assert np.abs(state.deviations.mean(axis=0)).max() < 1e-6


# --- the individual part --------------------------------------------------------------------------


def test_luck_does_not_separate_robots_and_the_share_shrinks() -> None:
    uphill = np.random.default_rng(2).standard_normal((10, 31))

    def credit(trials: Trials) -> np.ndarray:
        team = (trials.networks() * uphill).mean(axis=1).sum(axis=(1, 2))
        return team[:, None] + luck(trials)

    learner: Any = method("cone-es")
    state, shares = learner.init(Layout(6, 10, 10, 31), 3), []
    for _ in range(80):
        state = evolved(learner, state, credit, 1)
        shares.append(state.share)
    assert min(shares) == learner.config.individual_least
    assert np.median(shares[30:]) < 1.5 * min(shares)
    assert np.abs(state.deviations).max() < 0.1 * np.abs(state.mean).max()


def test_two_castes_emerge_where_two_kinds_of_robots_need_opposite_genes() -> None:
    kind = np.array([1, -1, 1, -1, -1, 1])
    learner = method("cone-es")
    state = evolved(learner, around(learner), lambda t: kind * worth(t) + luck(t), 80)
    flat = state.deviations.reshape(6, -1)
    np.testing.assert_array_equal(np.sign(np.corrcoef(flat)), np.outer(kind, kind))
    assert np.abs(np.corrcoef(flat)).min() > 0.7
    toward = (flat * UPHILL.ravel()).sum(axis=1)
    assert np.sign(toward).tolist() == kind.tolist()
    assert state.share == 1.0
    assert state.worth > 0
    team = state.progress.fittest_genes
    assert (team[0] != team[1]).any()


def test_robots_with_a_common_direction_share_their_findings() -> None:
    """A pure signal is kept entirely; the direction of a single generation is not."""
    learner = method("cone-es")
    state = evolved(learner, around(learner), luck, FIRST + 1)
    kind = np.array([1.0, -1, 1, -1, 1, -1])
    directions = np.random.default_rng(4).standard_normal((6, 4, 5))
    known = replace(state, directions=directions, likeness=np.outer(kind, kind), luck=1e-6)
    kept, signal = _signal(known, 0.9)
    common = np.tensordot(kind, directions, axes=1) / 6
    np.testing.assert_allclose(kept, kind[:, None, None] * common, atol=1e-5)
    assert signal == pytest.approx(1.0, abs=1e-6)
    kept, signal = _signal(replace(known, likeness=-np.outer(kind, kind), luck=1.0), 0.9)
    assert (np.abs(kept).max(), signal) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_the_filter_is_that_of_wiener(seed: int) -> None:
    """P (P + noise)^-1, where P is the likeness less its luck, computed without eigenvectors."""
    rng = np.random.default_rng(seed)
    n, age, memory = int(rng.integers(2, 12)), int(rng.integers(FIRST + 1, 60)), 0.9
    likeness = rng.standard_normal((n, n)) + rng.uniform(0, 2) * n**0.5 * np.eye(n)
    likeness = (likeness + likeness.T) / 2
    learner: Any = method("cone-es")
    state = replace(
        learner.init(replace(LAYOUT, n_robots=n), 1),
        directions=rng.standard_normal((n, 4, 5)),
        likeness=likeness,
        luck=float(rng.uniform(0, 30)),
        age=age,
    )
    n_genes = 5 * state.active.sum()
    kept, signal = _signal(state, memory)
    measured = likeness / (1 - memory ** (age - 1))
    faded = memory**age
    noise = state.luck / (1 - faded) * 0.1 / 1.9 * (1 + faded) / (1 - faded)
    lucky = noise * (2 * (n / n_genes) ** 0.5 + n / n_genes) / 2**0.5
    above = measured - lucky * np.eye(n)
    believed = (above + scipy.linalg.sqrtm(above @ above).real) / 2
    gain = believed @ np.linalg.inv(believed + noise * np.eye(n))
    expected = (gain @ state.directions.reshape(n, -1)).reshape(n, 4, 5)
    np.testing.assert_allclose(kept, expected, atol=1e-6)
    assert signal == pytest.approx(np.linalg.norm(gain, 2), abs=1e-6)


@pytest.mark.parametrize("n_robots", [2, 6, 20])
def test_luck_alone_is_rarely_mistaken_for_a_signal(n_robots: int) -> None:
    learner: Any = method("cone-es")
    state, signals = learner.init(Layout(n_robots, 10, 10, 31), 1), []
    rng = np.random.default_rng(3)
    while state.progress.generation < 70:
        asked, before = learner.ask(state), state.progress.generation
        fitness = rng.random(asked.teams.shape[:2])
        state = learner.tell(state, asked, Scores(fitness, fitness))
        if state.progress.generation > max(before, FIRST):
            signals.append(state.progress.numbers["individual_signal"])
    assert np.mean(np.array(signals) > learner.config.signal) < 0.1
    assert rms(state.deviations) < 0.01


# --- the team decides -----------------------------------------------------------------------------


def before_the_judgement(learner: Any) -> ConeEsState:
    """Return the state that asks for the finalists, of a team whose robots differ."""
    team = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 4, 5))
    state = around(learner, team)
    return told(learner, state, luck(learner.ask(state)))


def test_deviations_that_do_not_pay_decay_and_clones_are_the_fittest_team() -> None:
    learner = method("cone-es", pairs=10, decay=0.1)
    state = before_the_judgement(learner)
    trials = learner.ask(state)
    assert (trials.scenarios, trials.portrait, len(trials.teams)) == ("fixed", True, 2)
    team, clones = trials.networks()
    np.testing.assert_allclose(team, state.mean + state.deviations, atol=1e-6)
    np.testing.assert_array_equal(clones, np.broadcast_to(state.mean, clones.shape))
    credit = np.array([[1.0], [3.0]]) * np.ones(6)
    after = told(learner, state, credit)
    assert after.worth == pytest.approx(0.2 * (1 - 3) / (1 + 3))
    np.testing.assert_allclose(after.deviations, 0.9 * state.deviations, rtol=1e-6)
    assert after.progress.numbers["individual_worth"] == after.worth
    after = told(learner, after, luck(learner.ask(after)))
    trials = learner.ask(after)
    np.testing.assert_array_equal(trials.networks()[0, 0], trials.networks()[0, 5])
    last = told(learner, after, credit[::-1])  # clones 3, team 1 again
    np.testing.assert_array_equal(last.progress.fittest_fitness, 3.0)
    np.testing.assert_array_equal(last.progress.fittest_genes[0], last.progress.fittest_genes[5])
    assert last.worth == pytest.approx(0.8 * -0.1 + 0.2 * -0.5)


def test_deviations_that_pay_stay() -> None:
    learner = method("cone-es", pairs=10)
    state = before_the_judgement(learner)
    after = told(learner, state, np.array([[3.0], [1.0]]) * np.ones(6))
    assert after.worth == pytest.approx(0.1)
    np.testing.assert_array_equal(after.deviations, state.deviations)
    np.testing.assert_array_equal(after.progress.fittest_fitness, 3.0)


@pytest.mark.parametrize(
    ("team", "clones", "more"),
    [(np.nan, 1.0, -1), (1.0, -np.inf, 1), (np.nan, np.nan, 0), (0.0, 0.0, 0), (-1.0, -3.0, 0.5)],
)
def test_worth_of_any_numbers(team: float, clones: float, more: float) -> None:
    learner = method("cone-es", pairs=10)
    state = before_the_judgement(learner)
    after = told(learner, state, np.array([[team], [clones]]) * np.ones(6))
    assert after.worth == pytest.approx(0.2 * more)


# --- HomES, small teams, checks -------------------------------------------------------------------


def test_without_anything_individual_it_is_homes_bit_for_bit() -> None:
    ours, theirs = method("cone-es", individual=0, pairs=20), method("hom-es", pairs=20)
    a, b = (one.init(LAYOUT, 3) for one in (ours, theirs))
    while a.progress.generation < 6:
        trials, others = ours.ask(a), theirs.ask(b)
        np.testing.assert_array_equal(trials.networks(), others.networks())
        assert len(trials.teams) == (1 if a.phase == "fittest" else 40)
        assert np.array_equal(trials.networks()[:, 0], trials.networks()[:, 5])
        a, b = told(ours, a, worth(trials)), told(theirs, b, worth(others))
        same(a, b)
        assert not a.deviations.any()
        assert not set(a.progress.numbers)


def test_one_robot_has_nothing_to_deviate_from() -> None:
    learner: Any = method("cone-es", pairs=10)
    state = learner.init(replace(LAYOUT, n_robots=1), 3)
    while state.progress.generation < 10:
        trials = learner.ask(state)
        assert len(trials.teams) == (1 if state.phase == "fittest" else 20)
        state = told(learner, state, worth(trials))
    assert not state.deviations.any()
    assert state.share < learner.config.individual


def test_a_pair_of_every_round_is_individual_as_long_as_anything_is() -> None:
    learner = method("cone-es", pairs=10, rounds=5, individual=0.1)
    moves = learner.ask(around(learner)).networks().reshape(5, 2, 2, 6, 4, 5)[:, 0]
    own = np.ptp(moves, axis=2).max(axis=(2, 3)) > 0
    assert own.tolist() == [[True, False]] * 5


def test_an_impossible_state_is_recognized() -> None:
    learner: Any = method("cone-es", pairs=10)
    first = learner.init(LAYOUT, 3)
    good = evolved(learner, first, worth, 7)
    assert good.problem(first) == ""
    for name, value in (
        ("mean", good.mean[:2]),
        ("mean", good.mean * np.nan),
        ("deviations", good.deviations + 2),
        ("direction", good.direction[:, :1]),
        ("directions", good.directions[:2]),
        ("likeness", good.likeness * np.inf),
        ("active", good.active & False),
        ("share", 1.5),
        ("share", float("nan")),
        ("worth", -2.0),
        ("luck", -1.0),
        ("age", -1),
        ("best", good.best - 100),
        ("best", good.best[:1]),
        ("phase", "fittest"),
    ):
        with np.errstate(invalid="ignore"):
            assert replace(good, **{name: value}).problem(first) == name
