"""The study of a run, against the run's own records and teams played one by one."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.rng import fold
from conevo.runs.config import resolve
from conevo.runs.lab import Lab
from conevo.runs.start import start
from conevo.specialization import degree
from conevo.specialization.individual import independent_degree
from conevo.specialization.team import METRICS, Activity, measure
from conevo.studies import observation as observed
from conevo.studies.lesions import replacement
from conevo.studies.team_study import study
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import setting_columns
from conevo.worlds.pursuit.study import observation
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS
from conevo.worlds.pursuit.study.captures import COLLECTIVES, Capture, most_frequent
from conevo.worlds.rollout import Rollout
from runs.tiny import evolve_tiny, tiny_settings

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "light.py"
N = 3  # scenarios, as in a tiny run's testing phase
CHANGES: dict[str, dict[str, Any]] = {
    "rover/complex-5": {"world__n_robots": 6, "world__iterations": 60},
    "pursuit/team-4": {"world__iterations": 200, "world__arena_cm": 60.0},
    "prey/shaping-6": {"world__iterations": 60},
    "gacc/complex-2": {"world__n_robots": 8, "world__iterations": 60},
    f"{EXAMPLE}:dark-1": {"world__n_robots": 4},  # one heuristic only
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, conevo.Run]:
    """A tiny run of each world."""
    folder = tmp_path_factory.mktemp("runs")
    return {
        task: evolve_tiny(folder / str(k), "cone", task, **changes)
        for k, (task, changes) in enumerate(CHANGES.items())
    }


@pytest.fixture(scope="module")
def found(runs: dict[str, conevo.Run]) -> dict[str, dict[str, Any]]:
    """Their studies."""
    return {task: study(run, N, threads=1) for task, run in runs.items()}


def values(rows: list[dict[str, Any]], kind: str) -> dict[tuple[str, str], list[float]]:
    """Return the values by scenario of each team and measure of a study."""
    own = [row for row in rows if row["study"] == kind]
    teams = dict.fromkeys((row["team"], row["measure"]) for row in own)
    listed = {key: [row for row in own if (row["team"], row["measure"]) == key] for key in teams}
    for some in listed.values():
        assert [row["scenario"] for row in some] == list(range(len(some)))
    return {key: [row["value"] for row in some] for key, some in listed.items()}


@pytest.mark.parametrize("task", CHANGES)
def test_robots_are_those_of_the_testing_phase(task, runs, found) -> None:
    rows, tested = found[task]["robots"], runs[task].test_result["champion"]
    assert tested["scenarios"] == N
    assert [row["robot"] for row in rows] == list(range(len(tested["labels"])))
    assert [row["hidden"] for row in rows] == tested["n_hidden"]
    mean = np.mean([row["fitness"] for row in rows])
    assert mean == pytest.approx(tested["fitness"]["mean"], rel=1e-6)
    if not task.startswith("pursuit"):
        assert [row["caste"] for row in rows] == tested["labels"]
        assert [round(row["specialization"], 6) for row in rows] == tested["specialization"]


@pytest.mark.parametrize("task", CHANGES)
def test_actions_are_counted_over_all_scenarios(task, runs, found) -> None:
    run = runs[task]
    lab = Lab.equip(run.config, 1, "cpu")
    keys = [fold(run.config.run.seed, "test", k) for k in range(N)]
    outcome = lab.simulator.evaluate(*run.champion.as_trial(), lab.world.scenarios(keys))
    expected = outcome.counts[0].sum(axis=0)
    rows = found[task]["actions"]
    assert [row["count"] for row in rows] == expected.ravel().tolist()
    assert [row["action"] for row in rows] == list(lab.world.castes) * lab.world.n_robots
    assert expected.sum() > 0


@pytest.mark.parametrize("task", CHANGES)
def test_metrics_are_those_of_the_robots(task, runs, found) -> None:
    robots = found[task]["robots"]
    s = np.array([row["specialization"] for row in robots])
    assert list(found[task]["metrics"]) == list(METRICS)
    assert found[task]["metrics"]["specialization"] == pytest.approx(s.mean())
    if task.startswith("pursuit"):
        return
    counts = np.array([row["count"] for row in found[task]["actions"]]).reshape(len(robots), -1)
    labels, drawn = ([row[name] for row in robots] for name in ("caste", "independent"))
    columns = setting_columns(runs[task].config.build_world())
    expected = measure(Activity(counts, s, labels, np.array(drawn), columns))
    assert found[task]["metrics"] == pytest.approx(expected)


@pytest.mark.parametrize("task", [task for task in CHANGES if not task.startswith("pursuit")])
def test_favourites_are_those_of_the_counted_actions(task, runs, found) -> None:
    world = runs[task].config.build_world()
    chosen = getattr(world, "settings", world.castes)
    for row in found[task]["robots"]:
        lived = {one["action"]: one["count"] for one in found[task]["actions"]
                 if one["robot"] == row["robot"]}  # fmt: skip
        work = {name: lived[name] for name in chosen}
        most = max(work, key=work.get)
        first, second = sorted(work.values())[:-3:-1]
        if not first:
            assert row["favourite_setting"] is row["setting_share"] is row["affinity"] is None
            continue
        assert row["favourite_setting"] == most
        assert row["setting_share"] == pytest.approx(first / sum(work.values()))
        assert row["affinity"] == pytest.approx((first - second) / sum(work.values()))
        assert row["favourite_action"] == max(lived, key=lived.get)
        assert row["action_share"] == pytest.approx(max(lived.values()) / sum(lived.values()))
        if row["specialization"]:
            over = row["specialization"] / row["independent"]
            assert row["relative"] == pytest.approx(over)
        else:
            assert row["relative"] == 0


def test_favourites_of_rovers_are_settings_and_those_of_others_are_actions(found) -> None:
    """Otherwise the tests above would not have tested much."""
    assert {row["favourite_setting"] for row in found["rover/complex-5"]["robots"]} > {"low", "hi"}
    assert "move" in {row["favourite_action"] for row in found["rover/complex-5"]["robots"]}


@pytest.mark.parametrize("task", CHANGES)
def test_lesioned_teams_play_the_same_fresh_scenarios(task, runs, found) -> None:
    run = runs[task]
    lab = Lab.equip(run.config, 1, "cpu")
    scenarios = lab.world.scenarios([fold(run.config.run.seed, "lesion", k) for k in range(N)])
    labels = [row["caste"] for row in found[task]["robots"]]
    castes = set(labels)
    if task.startswith("pursuit"):
        castes -= {"non-specialized"}
    rows = values(found[task]["scores"], "lesion")
    measures = [one.name for one in measures_of(lab.world)]
    expected = {(team, name) for team in ("whole", *castes) for name in measures}
    assert set(rows) == expected
    for team in ("whole", *castes):
        stands_in = replacement(lab.world, team)
        modes = [[stands_in if caste == team else -1 for caste in labels]]
        played = lab.simulator.evaluate(*run.champion.as_trial(), scenarios, np.int32(modes))
        for name, result in played.performance.items():
            assert rows[team, name] == result[0].tolist()


@pytest.mark.parametrize("task", [task for task in CHANGES if not task.startswith("pursuit")])
def test_clones_are_of_the_fittest_and_not_of_movers(task, runs, found) -> None:
    run = runs[task]
    lab = Lab.equip(run.config, 1, "cpu")
    scenarios = lab.world.scenarios([fold(run.config.run.seed, "clones", k) for k in range(N)])
    robots = found[task]["robots"]
    castes = {row["caste"] for row in robots} - {"move"}
    rows = values(found[task]["scores"], "clones")
    assert {team for team, _ in rows} == {"whole", *castes}
    whole = run.champion
    for team in ("whole", *castes):
        own = [row for row in robots if row["caste"] == team]
        fittest = [max(own, key=lambda row: row["fitness"])["robot"]] * len(robots) if own else ...
        one = dataclasses.replace(whole, genes=whole.genes[fittest], active=whole.active[fittest])
        played = lab.simulator.evaluate(*one.as_trial(), scenarios)
        for name, result in played.performance.items():
            assert rows[team, name] == result[0].tolist()


def test_some_of_these_teams_have_castes_to_replace_and_to_clone(found) -> None:
    """Otherwise the tests above would not have tested much."""
    teams = {
        kind: Counter(len({row["team"] for row in one["scores"] if row["study"] == kind})
                      for one in found.values())
        for kind in ("lesion", "clones")
    }  # fmt: skip
    assert max(teams["lesion"]) >= 4
    assert max(teams["clones"]) >= 3


@pytest.mark.parametrize("task", CHANGES)
def test_a_study_is_plain_data_that_nothing_changes(task, runs, found) -> None:
    before = sorted((p, p.stat().st_mtime_ns) for p in runs[task].path.rglob("*"))
    again = study(conevo.Run(runs[task].path), N, threads=2)
    assert again == found[task]
    assert json.loads(json.dumps(again, allow_nan=False)) == again
    assert sorted((p, p.stat().st_mtime_ns) for p in runs[task].path.rglob("*")) == before
    assert list(again) == ["scores", "robots", "actions", "metrics", "behaviours"]
    assert {row["study"] for row in again["scores"]} == {"lesion", "clones", "rotated"}


def test_more_scenarios_start_with_the_same(runs, found) -> None:
    task = "rover/complex-5"
    rows = values(study(runs[task], N + 1, threads=1)["scores"], "lesion")
    for measured, few in values(found[task]["scores"], "lesion").items():
        if measured[0] == "whole":
            assert rows[measured][:N] == few
            assert len(rows[measured]) == N + 1


def test_twenty_scenarios_by_default(runs) -> None:
    rows = values(study(runs["prey/shaping-6"], threads=1)["scores"], "clones")
    assert {len(some) for some in rows.values()} == {20}


# --- predators ------------------------------------------------------------------------------------

PURSUIT = "pursuit/team-4"


def test_behaviours_of_predators(runs, found) -> None:
    watched = observed.observe(runs[PURSUIT], N, threads=1)
    seen, labels = watched.seen.seen, watched.labels
    assert [row["caste"] for row in found[PURSUIT]["robots"]] == labels
    of = [life.specialization for life in watched.lifetimes]
    assert [row["specialization"] for row in found[PURSUIT]["robots"]] == of
    kinds = ("individual", "member", "collective", "team")
    counts: dict[str, dict[str, int]] = {kind: {} for kind in kinds}
    for row in found[PURSUIT]["behaviours"]:
        counts[row["kind"]][row["behaviour"]] = row["count"]
    assert counts["individual"] == {
        name: labels.count(name) for name in (*BEHAVIOURS, "non-specialized")
    }
    members = watched.seen.composition(labels)
    assert counts["member"] == {name: n or 0 for name, n in members.items()}
    usual, captures = most_frequent(seen.all_captures)
    assert counts["collective"] == captures
    assert list(captures) == list(COLLECTIVES)
    assert counts["team"] == {usual: len(seen.all_captures)}
    assert sum(counts["member"].values()) == len(labels)


def test_predators_of_two_behaviours_are_composed(runs, monkeypatch: pytest.MonkeyPatch) -> None:
    labels = ["blocker", "pursuer", "blocker", "non-specialized", "pursuer"]
    monkeypatch.setattr(observed.Observed, "labels", labels)
    found = study(runs[PURSUIT], 2, threads=1)
    played = values(found["scores"], "composed")
    assert {team for team, _ in played} == {"pursuer-blocker", "spiders-fly"}
    fitness = [row["fitness"] for row in found["robots"]]
    pursuer, blocker = (max(of, key=lambda k: fitness[k]) for of in ((1, 4), (0, 2)))
    lab = Lab.equip(runs[PURSUIT].config, 1, "cpu")
    genes, rows = runs[PURSUIT].champion.as_trial()
    seed = runs[PURSUIT].config.run.seed
    places = observed.observe(runs[PURSUIT], 2, threads=1).seen.together(
        [fold(seed, "clones", k) for k in range(2)]
    )
    who = [pursuer] * 3 + [blocker] * 2
    alone = lab.simulator.evaluate(genes, np.ascontiguousarray(rows[:, who]), places)
    for name, result in alone.performance.items():
        assert played["pursuer-blocker", name] == result[0].tolist()


def test_captures_of_several_kinds(runs, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["spiders-fly", "entrapment", "spiders-fly", "none"]
    captures = [Capture(0, 0, 1, 2, ((),) * 5, False, 0, name) for name in names]
    monkeypatch.setattr(observation, "find_captures", lambda *_: captures)
    rows = study(runs[PURSUIT], 2, threads=1)["behaviours"]
    counts = {(row["kind"], row["behaviour"]): row["count"] for row in rows}
    assert counts["team", "spiders-fly"] == 8  # all captures of the team, of two scenarios
    assert counts["collective", "spiders-fly"] == 4
    assert counts["collective", "entrapment"] == counts["collective", "none"] == 2
    assert counts["collective", "role-switcher"] == 0


def test_only_predators_have_behaviours(found) -> None:
    assert all(not one["behaviours"] for task, one in found.items() if task != PURSUIT)


def test_metrics_of_predators_are_of_behaviours_not_of_motor_primitives(runs, found) -> None:
    lives = observed.observe(runs[PURSUIT], N, threads=1).lifetimes
    counts = np.array([[share * one.windows for share in one.shares.values()] for one in lives])
    assert counts.shape[1] == len(BEHAVIOURS) + 1
    assert degree([one.switches for one in lives], counts) == pytest.approx(
        [one.specialization for one in lives]
    )
    s, labels = np.array([one.specialization for one in lives]), [one.label for one in lives]
    behaviours = range(len(BEHAVIOURS))
    expected = measure(Activity(counts, s, labels, independent_degree(counts), behaviours))
    assert found[PURSUIT]["metrics"] == pytest.approx(expected, abs=1e-9)


@pytest.fixture
def staged(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Label predators by hand, and keep the played teams."""
    labels = ["knocker", "idle", "pursuer", "non-specialized", "pursuer"]
    told, played = observed.lifetimes, []
    evaluate = Rollout.evaluate

    def label_by_hand(*executed: Any) -> list[Any]:
        return [
            dataclasses.replace(one, label=name)
            for one, name in zip(told(*executed), labels, strict=True)
        ]

    def keep(
        self: Rollout, genes: Any, teams: Any, scenarios: Any, modes: Any = None, rounds: int = 1
    ) -> Any:
        played.append((teams, scenarios, modes))
        return evaluate(self, genes, teams, scenarios, modes, rounds)

    monkeypatch.setattr(observed, "lifetimes", label_by_hand)
    monkeypatch.setattr(Rollout, "evaluate", keep)
    return played


def test_only_specialized_predators_are_replaced_and_the_idle_not_cloned(runs, staged) -> None:
    rows = study(runs[PURSUIT], N, threads=1)["scores"]
    teams = {kind: [key[0] for key in values(rows, kind)][::4] for kind in ("lesion", "clones")}
    assert teams["lesion"] == ["whole", "pursuer", "knocker", "idle"]
    assert teams["clones"] == ["whole", "pursuer", "knocker"]
    _, (_, _, modes), _, (cloned, _, _) = staged
    assert modes.tolist() == [
        [-1, -1, -1, -1, -1],
        [-1, -1, 0, -1, 0],
        [0, -1, -1, -1, -1],
        [-1, 0, -1, -1, -1],
    ]
    whole = cloned[0]
    # All predators have the same fitness, so the first pursuer is the fittest.
    assert (cloned[1] == whole[2]).all()
    assert (cloned[2] == whole[0]).all()


def test_clones_start_together_in_sight_of_the_prey(runs, staged) -> None:
    study(runs[PURSUIT], 12, threads=1)
    scenarios = staged[-1][1]
    place = np.stack([scenarios.x, scenarios.y], axis=-1).astype(float)  # [E, 5 and the prey, 2]
    assert place.shape == (12, 6, 2)
    gaps = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1) - 5.5
    gaps += np.where(np.eye(6, dtype=bool), np.inf, 0)
    assert gaps.min() > 0
    assert (gaps[:, :5, 5] <= 22).all()
    assert (gaps[:, :5, :5].min(axis=-1) <= 22).all()
    assert len(np.unique(scenarios.heading)) == scenarios.heading.size
    lesioned = staged[-2][1]
    far = np.hypot(lesioned.x[:, :5] - lesioned.x[:, 5:], lesioned.y[:, :5] - lesioned.y[:, 5:])
    assert (far > 27.5).any()  # elsewhere they start anywhere


@pytest.mark.parametrize("change", [{"world__n_obstacles": 3}, {"world__sensor_range_cm": 1.0}])
def test_predators_that_do_not_fit_together_start_anywhere(tmp_path, staged, change) -> None:
    run = evolve_tiny(tmp_path / "run", "cone", PURSUIT, **(CHANGES[PURSUIT] | change))
    staged.clear()
    study(run, N, threads=1)
    world = run.config.build_world()
    drawn = world.scenarios([fold(run.config.run.seed, "clones", k) for k in range(N)])
    for axis in ("x", "y", "heading"):
        assert (getattr(staged[-1][1], axis) == getattr(drawn, axis)).all()


# --- errors ---------------------------------------------------------------------------------------


def test_values_that_are_not_finite_keep_their_place(runs, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate = Rollout.evaluate

    def spoiled(self: Rollout, *args: Any) -> Any:
        outcome = evaluate(self, *args)
        outcome.performance["value"][0, 1] = np.nan
        outcome.performance["area"][0, 0] = np.inf
        outcome.fitness[0, 2, 4] = np.nan
        return outcome

    monkeypatch.setattr(Rollout, "evaluate", spoiled)
    found = study(runs["rover/complex-5"], N, threads=1)
    json.dumps(found, allow_nan=False)
    for kind in ("lesion", "clones"):
        missing = {("whole", "value", 1), ("whole", "area", 0)}
        own = [row for row in found["scores"] if row["study"] == kind]
        values = {(row["team"], row["measure"], row["scenario"]): row["value"] for row in own}
        teams = {row["team"] for row in own}
        grid = {(t, m, k) for t in teams for m in ("value", "area") for k in range(N)}
        assert values.keys() == grid
        assert {place for place, value in values.items() if value is None} == missing
    assert [row["robot"] for row in found["robots"] if row["fitness"] is None] == [4]


def test_a_run_without_a_team_and_one_of_other_kernels_are_refused(
    runs, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = tiny_settings("cone")
    config = resolve("rover/complex-1", "cone", "smoke", 1, None, settings)
    with pytest.raises(UsageError, match="no finished generation yet"):
        study(start(config, tmp_path / "run", threads=1))
    monkeypatch.setattr(Rollout, "fingerprint", "another")
    with pytest.raises(UsageError, match="other kernels"):
        study(runs["rover/complex-5"])
