"""The scripts of experiments/: the rule by hand, blind rovers, and tables of measurements."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.evolution import Layout, Scores
from conevo.report.foreign import read_foreign
from conevo.runs import checkpoint

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "experiments"))  # scripts import what they share
CALIBRATION = ROOT / "docs" / "results" / "calibration.md"

import calibration  # noqa: E402
import calibration_tables as tables  # noqa: E402
import draw_team_map  # noqa: E402
import pages  # noqa: E402
import reference_q  # noqa: E402
from blind import Blind, kind  # noqa: E402
from incentives import Regime, fitted, incentive, residence, value  # noqa: E402

RANGES, ACCURACIES = (0.07, 0.05, 0.03), (0.7, 0.8, 0.9)


def regime(segregation=0.0, starts="random", iterations=1250, n_robots=20, **other):
    return Regime(
        **{"segregation": segregation, "starts": starts, "ranges": RANGES} | other,
        accuracies=ACCURACIES, iterations=iterations, n_robots=n_robots,
    )  # fmt: skip


def test_two_switchers_for_one_iteration_by_hand():
    """The only pair is in range of a rock with the product of two discs' areas."""
    low, med, hi = (math.pi * r**2 for r in RANGES)
    expected = (
        500 * low * low * 0.25 * 0.25 * 0.7 * 0.7
        + 1000 * low * med * 2 * 0.25 * 0.25 * 0.7 * 0.8
        + 1500 * med * hi * 2 * 0.25 * 0.25 * 0.8 * 0.9
        + 2000 * hi * hi * 0.25 * 0.25 * 0.9 * 0.9
    )
    found = value(regime(iterations=1, n_robots=2), "switchers")
    assert found == pytest.approx(expected, rel=0.05)  # a contact cannot be longer than that
    assert found < expected  # two detections of one rock count once


def test_two_castes_by_hand():
    """Rovers 0 and 1 are both low, one for A and one for B: they only ever detect A."""
    low = math.pi * RANGES[0] ** 2
    expected = 500 * low**2 * 0.7**2 * 0.7**2
    found = value(regime(iterations=1, n_robots=2), "castes")
    assert found == pytest.approx(expected, rel=0.2)


def test_with_unlimited_time_everything_is_found():
    endless = regime(iterations=10**9, ranges=(0.2, 0.15, 0.1))
    assert value(endless, "switchers") == pytest.approx(5000)
    assert incentive(endless) == pytest.approx(1)


def test_the_value_is_linear_in_segregation():
    for starts in ("random", "by_robot"):
        for team in ("castes", "switchers"):
            ends = [value(regime(s, starts), team) for s in (0.0, 1.0)]
            middle = value(regime(0.25, starts), team)
            assert middle == pytest.approx(0.75 * ends[0] + 0.25 * ends[1])
    assert incentive(regime(1.0, "by_robot")) > incentive(regime(0.0, "by_robot"))
    assert incentive(regime(1.0, "random")) == pytest.approx(incentive(regime(0.0, "random")))


def test_a_walker_leaves_its_quarter_slowly():
    assert residence(0.3, 1) == pytest.approx(1, abs=0.02)
    assert residence(0.3, 10**9) == pytest.approx(0.25, abs=0.01)
    rng = np.random.default_rng(1)
    at = rng.random((4000, 2)) / 2
    inside = []
    for _ in range(1250):
        angle = rng.random(4000) * 2 * np.pi
        step = 0.01 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        at = np.abs(at + step * (rng.random(4000) < 0.3)[:, None])
        at = 1 - np.abs(1 - at)
        inside.append((at < 0.5).all(axis=1).mean())
    assert residence(0.3, 1250) == pytest.approx(np.mean(inside), abs=0.02)


def test_the_constant_is_found_without_the_cells_for_testing():
    cells = [(regime(s, "by_robot", n), 0.0) for s in (0.0, 0.5, 1.0) for n in (600, 1250)]
    known = [(one, incentive(one, 3.3)) for one, _ in cells]
    assert fitted([*known, (regime(0.25), 99.0), (regime(0.75), 0.01)]) == 3.3


def test_blind_rovers_divide_their_time_by_their_shares():
    world = conevo.world("rover/complex-5", iterations=400)
    genes = np.stack([kind((1, 2, 1, 4), 1), kind((0, 0, 0, 1), 40, draw=3), kind((0, 1, 0, 0), 1)])
    who = np.arange(20) % 3
    rollout = conevo.Rollout(world, Blind(), n_threads=1)
    scenarios = world.scenarios([5])
    counts = rollout.evaluate(genes, who[None, :, None].astype(np.int32), scenarios).counts[0, 0]
    mean = counts[who == 0].mean(axis=0) / 400
    assert mean == pytest.approx([0.125, 0.25, 0.125, 0.5], abs=0.03)
    assert counts[who == 1].tolist() == [[0, 0, 0, 400]] * 7
    assert counts[who == 2].tolist() == [[0, 400, 0, 0]] * 6
    seen = rollout.record(genes, who[:, None].astype(np.int32), scenarios)
    steps = np.diff(np.stack([seen["x"], seen["y"]], axis=2), axis=0)
    has_turned = (np.abs(np.diff(steps[:, who == 1], axis=0)) > 1e-5).any(axis=2)
    assert 0.005 < has_turned.mean() < 0.12  # every 40 moves, and when it is refused


def test_each_robot_of_a_caste_uses_a_setting_of_its_region():
    """Regions 0 to 3 have A (low, low), B (low, med), C (med, hi), D (hi, hi)."""
    assert calibration.by_place(8).tolist() == [0, 0, 1, 2, 0, 1, 2, 2]


def test_a_ratio_and_its_error_by_hand():
    found = calibration.of_pair(np.array([2.0, 4.0]), np.array([4.0, 4.0]), "blind ")
    assert found["blind ratio"] == 0.75
    assert found["blind log ratio se"] == pytest.approx(1 / 3)  # of -1 and 1, over the mean of 3


def test_requirements_of_a_reading():
    row = {"random": 50.0, "blind switchers": 4100.0, "blind castes": 3900.0}
    row |= {f"complex-{e}": 3000.0 + e for e in range(1, 11)}
    row |= {f"simple-{e}": 2900.0 + e for e in range(1, 11)}
    row |= {"top -30 %": 0.8, "top +30 %": 1.2}
    assert tables.n_met(row) == len(tables.CRITERIA) == 5
    for name, change in {
        "complex > simple": {"simple-1": 9999.0},
        "environment 10 best": {"complex-3": 3011.0},
        "±30 % < 25 %": {"top -30 %": 0.7},
        "random <= 100": {"random": 101.0},
        "best blind >= 4000": {"blind switchers": 3999.0},
    }.items():
        other = row | change
        assert [one for one, is_met in tables.CRITERIA.items() if not is_met(other)] == [name]


@pytest.mark.skipif(
    not CALIBRATION.with_suffix(".csv").is_file(), reason="the source package has no results"
)
def test_the_page_s_tables_are_those_of_its_numbers():
    page = CALIBRATION
    text = page.read_text()
    for name, (part, make) in tables.PAGE_PARTS.items():
        rows = pages.read(page.with_name(f"calibration{tables.PARTS[part]}.csv"))
        assert f"<!-- {name} -->\n{make(rows)}<!-- end -->" in text, name


# --- robots that learn by Q-learning ------------------------------------------------------------


def q_learners(n_actions=2):
    """Return one robot with one sensor between 0 and 1, of two bins."""
    return reference_q.Learners(np.zeros(1), np.ones(1), np.zeros((1, n_actions, 3)), 2)


def test_a_q_learners_features_are_a_bin_of_each_sensor_and_a_one():
    seen = np.array([[[0.0]], [[0.49]], [[0.5]], [[1.0]], [[7.0]]])
    bins = q_learners().features(seen)[:, 0].tolist()
    assert bins == [[1, 0, 1], [1, 0, 1], [0, 1, 1], [0, 1, 1], [0, 1, 1]]


def test_a_step_of_q_learning_by_hand():
    """Reward 3, and 0.99 x 8 to come: a tenth of the error 10.92 - 4, shared by two features."""
    robot = q_learners()
    low, high = (robot.features(np.array([[[x]]])) for x in (0.0, 1.0))
    robot.values[0, 0], robot.values[0, 1] = [4, 0, 0], [0, 8, 0]
    robot.learn(low, np.array([[0]]), np.array([[3.0]]), high)
    assert robot.values[0, 0].tolist() == pytest.approx([4 + 0.346, 0, 0.346])
    assert robot.values[0, 1].tolist() == [0, 8, 0]  # the other action
    robot.learn(low, np.array([[1]]), np.array([[3.0]]), None)  # the end: nothing to come
    assert robot.values[0, 1].tolist() == pytest.approx([0.15, 8, 0.15])


def test_teams_side_by_side_teach_the_mean_of_their_errors():
    robot = q_learners()
    low = robot.features(np.zeros((4, 1, 1)))
    robot.learn(low, np.array([[0], [0], [0], [1]]), np.array([[1.0], [2.0], [6.0], [10.0]]), None)
    assert robot.values[0].tolist() == [[0.15, 0, 0.15], [0.5, 0, 0.5]]


def test_values_converge_to_the_rewards_to_come():
    """Two states: action 1 leads to the other one, and pays 1 where the sensor is low."""
    robot, rng = q_learners(), np.random.default_rng(1)
    state = np.zeros(8, int)
    for _ in range(4000):
        before = robot.features(state[:, None, None].astype(float))
        actions = robot.choose(before, 0.5, rng)
        rewards = ((actions[:, 0] == 1) & (state == 0)).astype(float)[:, None]
        state = np.where(actions[:, 0] == 1, 1 - state, state)
        robot.learn(before, actions, rewards, robot.features(state[:, None, None].astype(float)))
    q = robot.q(robot.features(np.array([[[0.0]], [[1.0]]])))[:, 0]
    assert q[0, 1] == pytest.approx(1 / (1 - 0.99**2), rel=0.05)  # 1, then one step without
    assert q.argmax(axis=1).tolist() == [1, 1]


@pytest.mark.parametrize("reward", reference_q.REWARDS)
def test_the_script_of_q_learners_writes_what_a_report_reads(reward, tmp_path):
    params = {"iterations": 10, "prey": "heuristic"}
    rows = reference_q.trained("pursuit/team-3", reward, 1, 480, tmp_path, params, n_tests=4)
    assert [row["policy"] for row in rows] == ["greedy", "epsilon-greedy"]
    assert all(row["team-steps"] == 480 for row in rows)
    stem = f"pursuit-team-3-{reward}-s1"
    assert {one.name for one in tmp_path.iterdir()} == {
        f"{stem}.{e}" for e in ("json", "toml", "npz")
    }
    found = {one.measure: one for one in read_foreign([tmp_path / f"{stem}.json"], "team")}
    one = found["capture_time"]
    assert (one.algorithm, one.about["parameters"], one.about["shared"]) == (
        f"q-{reward}",
        245,
        False,
    )
    assert [steps for steps, _ in one.runs[0]] == [160, 320, 480]
    assert "pursuit-team-3" in one.names


def test_q_learners_need_named_actions(tmp_path, capsys, monkeypatch):
    light = f"{ROOT}/examples/light.py:dark-1"
    monkeypatch.setattr(
        sys, "argv", ["reference_q.py", "--work", f"{tmp_path}/q", "--tasks", light]
    )
    assert reference_q.main() == 2
    assert "declares no discrete actions" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_map_of_teams_is_that_of_the_newest_checkpoint(tmp_path):
    learner = conevo.method("map-elites", genotypes=9, bins=3)
    state = learner.init(Layout(n_robots=2, n_hidden=2, max_hidden=2, n_genes=3), 1)
    for name in ("checkpoint-b.npz", "checkpoint-a.npz"):
        generation = state.progress.generation
        while state.progress.generation == generation:
            trials = learner.ask(state)
            credit = trials.networks()[:, :, 0, 0].astype(float)
            shares = np.stack([credit > 0, credit < -0.5], axis=2).astype(float)
            state = learner.tell(state, trials, Scores(credit, 0 * credit, shares))
        checkpoint.save(tmp_path / name, state, {})
    found = draw_team_map.newest_map(tmp_path)
    np.testing.assert_array_equal(found.ravel(), state.map.fitness)
    assert found.shape == (3, 3)
    assert 0 < np.isfinite(found).sum() < 9
    checkpoint.save(tmp_path / "checkpoint-a.npz", state.progress, {})
    with pytest.raises(ValueError, match="its method has no map of teams"):
        draw_team_map.newest_map(tmp_path)
