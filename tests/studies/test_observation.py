"""From a run on disk to behaviours, their reproduction, and tables 4.4 and 4.5."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.rng import fold, stream
from conevo.runs.champions import Team
from conevo.runs.shrinkage import shrinkage
from conevo.studies.lifetimes import lifetimes
from conevo.studies.observation import Observed, observe
from conevo.studies.team_study import study
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS
from conevo.worlds.pursuit.study.captures import COLLECTIVES
from conevo.worlds.pursuit.study.observation import Observation, record_team
from conevo.worlds.pursuit.study.predators import Predators
from conevo.worlds.pursuit.study.reproduction import (
    place_together,
    reproduce_collectives,
    reproduce_individuals,
)
from conevo.worlds.pursuit.world import PursuitParams, PursuitWorld
from conevo.worlds.registry import WORLDS, WorldEntry, studies, study_of
from conevo.worlds.rollout import Rollout
from runs.tiny import evolve_tiny

sys.path.append(str(Path(__file__).resolve().parents[2] / "experiments"))

from caste_tables import composition_table, fittest_runs, lesion_table

TINY = {
    "run.generations": 2,
    "run.epochs": 1,
    "run.fittest_epochs": 2,
    "run.n_validations": 20,
    "run.n_tests": 2,
    "world.iterations": 200,
    "world.arena_cm": 60.0,
    "world.prey": "random",
}
# Chosen so that the runs have specialized predators (CONE's) and captures by several predators (the
# last one of HomCNE's).
SEEDS = {"cone": (4, 15), "homcne": (1, 69)}
SIZES = {
    "cone": {"method.genotypes": 4, "method.rounds": 2},
    "homcne": {"method.genotypes": 12},
}


def evolve(path: Path, method: str, seed: int) -> conevo.Run:
    settings: dict[str, Any] = TINY | SIZES[method]
    return conevo.evolve(
        "pursuit/team-2", method, "smoke", seed, path, overrides=settings, threads=1
    )


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[conevo.Run]:
    """Two tiny runs of each of two methods."""
    folder = tmp_path_factory.mktemp("runs")
    return [
        evolve(folder / f"{method}-{seed}", method, seed)
        for method, seeds in SEEDS.items()
        for seed in seeds
    ]


@pytest.fixture(scope="module")
def watched(runs: list[conevo.Run]) -> Observed:
    """The team of the last run, which captures the prey occasionally."""
    return observe(runs[3], 4, threads=1)


@pytest.fixture(scope="module")
def seen(watched: Observed) -> Observation:
    """Its observed behaviours."""
    return observation(watched)


def observation(watched: Observed) -> Observation:
    """Return the observation of a team by the world's study."""
    assert isinstance(watched.seen, Predators)
    return watched.seen.seen


# --- observing ------------------------------------------------------------------------------------


def test_the_records_are_those_of_the_testing_phase(runs, seen: Observation) -> None:
    assert seen.keys == tuple(fold(SEEDS["homcne"][1], "test", k) for k in range(4))
    tested = runs[3].test(4)["performance"]["capture_time"]
    times = [(one["captured"] > 0).any(axis=1).sum() for one in seen.records]
    assert times == tested["values"]
    assert seen.capture_time == tested["mean"] > 0


def test_threads_change_nothing_and_another_seed_does(runs, watched, seen: Observation) -> None:
    watched_again = observe(runs[3], 4, threads=2)
    again = observation(watched_again)
    for one, other in zip(seen.records, again.records, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one)
    assert watched_again.lifetimes == watched.lifetimes
    assert again.captures == seen.captures
    assert observation(observe(runs[3], 4, seed=77, threads=1)).keys != seen.keys


def test_captured_iterations_are_those_of_the_captures(seen: Observation) -> None:
    for record, captures in zip(seen.records, seen.captures, strict=True):
        held = np.zeros(len(record["x"]), dtype=bool)
        for one in captures:
            assert one.start <= one.first < one.stop
            held[one.first : one.stop] = True
        caught = record["captured"][:, 0] > 0
        assert (caught <= held).all()
        assert held.sum() - caught.sum() <= 9 * sum(map(len, seen.captures))


def test_an_instance_is_sensed_within_range_of_prey_and_predator(seen: Observation) -> None:
    assert len(seen.spells) > 20
    for one in seen.spells:
        record = seen.records[one.epoch]
        place = np.stack([record["x"], record["y"]], axis=-1)[one.start : one.stop]
        gaps = np.linalg.norm(place - place[:, [one.predator]], axis=-1) - 5.5
        others = np.delete(gaps[:, :3], one.predator, axis=1)
        assert (gaps[:, 3] <= 22.001).all()
        assert (others.min(axis=1) <= 22.001).all()


def test_sensor_table_of_a_team(seen: Observation) -> None:
    rows = seen.sensor_table()
    assert {row["behaviour"] for row in rows} == {one.behaviour for one in seen.spells}
    for row in rows:
        assert 1 <= row["instances"] <= 20
        for kind in ("proximity", "light"):
            assert len(row[kind]) == 8
            # An average lies between the lower and the upper ends of the segments it is made of.
            portions = np.array(row[f"{kind}_profile"])
            mean = np.mean(row[kind])
            assert portions @ np.arange(10) / 10 <= mean + 1e-6
            assert mean <= portions @ np.arange(1, 11) / 10 + 1e-6


def test_a_run_of_another_world_is_refused(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "rovers")
    with pytest.raises(UsageError, match=r"run of rover-v2/complex-1.*predators of pursuit-v2"):
        observe(run)
    with pytest.raises(UsageError, match="pursuit-v2"):
        composition_table([run])


# --- your own worlds ------------------------------------------------------------------------------

SUBCLASS = """
from dataclasses import dataclass
from typing import ClassVar

from conevo.worlds.pursuit.world import PursuitParams, PursuitWorld
from conevo.worlds.registry import WorldEntry


@dataclass(frozen=True)
class MyWorld(PursuitWorld):
    name: ClassVar[str] = "mine-v1"


ENTRY = WorldEntry("mine-v1", "Mine", "", "", ("team-2",), "PursuitParams", "MyWorld")
"""


def test_a_subclass_is_studied_like_the_world_it_inherits(tmp_path: Path, capsys) -> None:
    (tmp_path / "mine.py").write_text(SUBCLASS)
    settings: dict[str, Any] = TINY | SIZES["homcne"] | {"run.generations": 1}
    task, path = f"{tmp_path / 'mine.py'}:team-2", tmp_path / "run"
    run = conevo.evolve(task, "homcne", "smoke", 2, path, overrides=settings, threads=1)
    found = observe(run, 2, threads=1).report
    assert found["task"] == "mine-v1/team-2"
    tested = run.test(2)["performance"]["capture_time"]["mean"]
    assert found["capture_time"] == pytest.approx(tested)
    labels = [life["label"] for life in found["predators"]]
    assert [row["caste"] for row in study(run, 2, threads=1)["robots"]] == labels
    code, out, err = say(capsys, "behaviours", str(path), "--scenarios", "2")
    assert (code, err) == (0, "")
    assert [out.count(f"predator {k}  ") > 0 for k in range(4)] == [True, True, True, False]


@pytest.mark.parametrize(
    ("studied", "words"),
    [
        ("no.such.study", "world mine-v1: its study 'no.such.study' is not there: No module named"),
        ("json", "world mine-v1: its study 'json' has no BEHAVIOURS, no COLLECTIVES, no WORDS"),
    ],
)
def test_an_entry_with_an_invalid_study_is_one_line(studied: str, words: str) -> None:
    entry = WorldEntry("mine-v1", "Mine", "", "", ("a-1",), "Params", "World", studied=studied)
    with pytest.raises(UsageError, match=f"^{re.escape(words)}"):
        study_of(entry)


def test_only_studied_worlds_are_found_and_names_are_distinct() -> None:
    of = {name: study_of(entry) for name, entry in WORLDS.items()}
    assert {name for name, one in of.items() if one is not None} == set(studies())
    for one in studies().values():
        assert "none" not in one.BEHAVIOURS
        assert one.COLLECTIVES[-1] == "none"
        names = (*one.BEHAVIOURS, *one.COLLECTIVES)
        assert len(set(names)) == len(names)


# --- reproduction ---------------------------------------------------------------------------------


def by_hand(outputs: list[tuple[float, float]], **params: Any) -> Observation:
    """Return a team whose wheels do not depend on what it senses, observed in twelve scenarios."""
    world = PursuitWorld(
        f"team-{len(outputs) - 1}",
        PursuitParams(iterations=200, arena_cm=60.0, prey="heuristic", **params),
    )
    rollout = Rollout(world, n_threads=1)
    genes = np.zeros((len(outputs), rollout.genome.max_parts, 24), dtype=np.float32)
    genes[:, 0, 22:] = outputs
    active = np.zeros(genes.shape[:2], dtype=bool)
    active[:, 0] = True
    zeros = np.zeros(len(outputs))
    pool, (rows,) = Team(0, genes, active, zeros, zeros).as_trial()
    return record_team(rollout, pool, rows, range(12), seed=5)


def test_a_predator_that_never_moves_is_idle_and_reproduces_it() -> None:
    seen = by_hand([(0.0, 0.0), (0.0, 0.0), (0.5, 0.5)])
    lives = lifetimes(Predators(seen).executed, BEHAVIOURS)
    assert [life.label for life in lives[:2]] == ["idle", "idle"]
    rows = [row for row in reproduce_individuals(seen) if row["predator"] < 2]
    assert {row["behaviour"] for row in rows} == {"idle"}
    for row in rows:
        assert (row["result"], row["reproduced"], row["is_reproduced"]) == ("idle", 1.0, True)
        assert (row["primitive"], row["left"], row["right"]) == ("stop", 0.0, 0.0)


def test_a_predator_that_drives_straight_on_never_idles() -> None:
    seen = by_hand([(1.0, 1.0), (1.0, 1.0), (0.0, 0.0)])
    rows = [row for row in reproduce_individuals(seen) if row["predator"] < 2]
    assert rows
    for row in rows:
        assert row["result"] != "idle"
        assert row["primitive"] == "forward"
        assert row["left"] == row["right"] > 0.9
        assert row["is_reproduced"] == (row["result"] == row["behaviour"])


def test_clamped_sensors_determine_the_reproduced_behaviour(seen: Observation) -> None:
    """With the averages of another behaviour's row, the same controller drives differently."""
    rows = reproduce_individuals(seen)
    assert rows == reproduce_individuals(seen)
    assert all(len(row["sensors"]) == 16 and row["trials"] >= 1 for row in rows)
    assert all(0 <= row["reproduced"] <= 1 for row in rows)
    assert len({(row["predator"], row["behaviour"]) for row in rows}) == len(rows)
    assert len({round(row["left"], 3) for row in rows}) > 1


@pytest.mark.parametrize("at_wall", [False, True])
def test_predators_are_placed_according_to_their_roles(at_wall: bool) -> None:
    seen = by_hand([(0.0, 0.0)] * 4)
    roles = ["pursuer", "blocker", "flanker", ""]
    for k in range(50):
        poses = place_together(stream(k, "test"), seen, roles, at_wall=at_wall)
        prey, own = poses[4].astype(float), poses[:4].astype(float)
        gaps = np.hypot(*(own[:, None, :2] - poses[None, :, :2]).T).T - 5.5
        np.fill_diagonal(gaps, np.inf)
        assert gaps.min() > 0
        assert (gaps[:, 4] <= 22).all()
        assert (gaps[:, :4].min(axis=1) <= 22).all()
        assert (poses[:, :2] >= 2.75).all()
        assert (poses[:, :2] <= 60 - 2.75).all()
        seen_at = np.arctan2(own[:, 1] - prey[1], own[:, 0] - prey[0]) - prey[2]
        bearing = np.abs(np.degrees((seen_at + math.pi) % (2 * math.pi) - math.pi))
        assert bearing[0] >= 44.99
        assert bearing[1] <= 45.01
        assert 89.99 <= bearing[2] <= 165.01
        if at_wall:
            assert min(*prey[:2], *(60 - prey[:2])) - 2.75 <= 22.001


def test_observed_collective_behaviours_are_tried_again(seen: Observation) -> None:
    named = {one.collective for one in seen.all_captures} - {"none"}
    assert named  # the team was chosen because it has some
    for is_clamped in (False, True):
        rows = reproduce_collectives(seen, trials=3, clamped=is_clamped)
        assert {row["collective"] for row in rows} == named
        for row in rows:
            assert len(row["roles"]) == 3
            assert set(row["roles"]) <= {"", *BEHAVIOURS}
            assert 0 <= row["reproduced"] <= row["captured"] <= row["trials"] == 3
            assert set(row["seen"]) == set(COLLECTIVES)
            assert row["is_reproduced"] == (row["seen"][row["collective"]] > 0)


def test_predators_that_never_move_form_no_collective_behaviour() -> None:
    assert reproduce_collectives(by_hand([(0.0, 0.0)] * 3)) == []


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, dict[str, Any]]]:
    """Return a list that fills with every scenario played and its record."""
    plays: list[tuple[Any, dict[str, Any]]] = []
    original = Rollout.record

    def record(self: Rollout, genes: Any, team: Any, scenarios: Any) -> dict[str, Any]:
        found = original(self, genes, team, scenarios)
        plays.append((scenarios, found))
        return found

    monkeypatch.setattr(Rollout, "record", record)
    return plays


def test_trials_start_where_instances_did_with_one_predator_clamped(seen, played) -> None:
    (first, *_) = rows = reproduce_individuals(seen)
    assert len(played) == sum(row["trials"] for row in rows)
    places = [(one["x"], one["y"], one["heading"]) for one in seen.records]
    for scenario, record in played[: first["trials"]]:
        held = np.array(first["sensors"], dtype=np.float32)
        assert (record["inputs"][:, first["predator"]] == held).all()
        others = np.delete(scenario.clamp, first["predator"], axis=0)
        assert np.isnan(others).all()
        start = (scenario.x[0], scenario.y[0], scenario.heading[0])
        assert any(
            (np.stack(start) == np.stack([axis[one.start - 1] for axis in places[one.epoch]])).all()
            for one in seen.spells
            if (one.predator, one.behaviour) == (first["predator"], first["behaviour"])
        )


@pytest.mark.parametrize("is_clamped", [False, True])
def test_predators_put_together_are_clamped_only_if_asked(seen, played, is_clamped) -> None:
    rows = reproduce_collectives(seen, trials=2, clamped=is_clamped)
    assert len(played) == 2 * len(rows)
    for (scenario, record), row in zip(played[::2], rows, strict=True):
        for i, role in enumerate(row["roles"]):
            is_held = is_clamped and bool(role) and bool(seen.instances(role, i))
            assert np.isnan(scenario.clamp[i]).all() != is_held
            constant = (record["inputs"][:, i] == record["inputs"][0, i]).all()
            assert constant or not is_held


# --- tables ---------------------------------------------------------------------------------------


def fake(method: str, fitness: float | None, validated: float | None = None) -> Any:
    zeros = np.zeros(2)
    champion = None if fitness is None else Team(0, zeros, zeros > 0, zeros + fitness, zeros)
    result = None
    if validated is not None:
        part = {"fitness": {"mean": validated}, "performance": {}}
        one = {"generation": 0, "selection": {"fitness": fitness, "performance": {}}}
        about = {"chosen": 0, "finalists": [one | {"validation": part}]}
        result = {"champion": part, "validation": about}
    about: dict[str, Any] = {"champion": champion, "path": "here", "test_result": result}
    return SimpleNamespace(config=SimpleNamespace(method=method), generations=list, **about)


def test_the_fittest_run_of_each_method() -> None:
    some = [fake("cone", 1), fake("mesp", 5), fake("cone", 3), fake("cone", 3), fake("mesp", 4)]
    assert list(fittest_runs(some).values()) == [some[2], some[1]]
    lucky = [fake("cone", 9, 1), fake("cone", 4, 3), fake("cone", 2, 3)]
    assert fittest_runs(lucky) == {"cone": lucky[1]}
    assert fittest_runs([*lucky, fake("cone", 5)]) == {"cone": lucky[0]}  # one was not validated
    with pytest.raises(UsageError, match="no finished generation"):
        fittest_runs([fake("cone", None)])
    for table in (composition_table, lesion_table):
        with pytest.raises(UsageError, match="no runs were given"):
            table([])


def test_table_4_4_of_runs(runs) -> None:
    rows = composition_table(iter(runs), 4, threads=1)
    assert [row["method"] for row in rows] == ["cone", "homcne"]
    for row in rows:
        counts = [row[name] for name in (*COLLECTIVES[:-1], "non-specialized")]
        assert sum(n for n in counts if n is not None) == row["predators"] == 3
        assert row["non-specialized"] >= row["labels"].count("non-specialized")
    best = max(runs[2:], key=lambda run: shrinkage(run.test_result)[0]["validation"]["mean"])
    assert rows[1]["run"] == str(best.path)
    json.dumps(rows)


def test_table_4_5_replaces_the_specialized_by_the_heuristic(runs) -> None:
    rows = lesion_table(runs, 5, threads=1)
    assert [row["method"] for row in rows] == ["cone", "homcne"]
    json.dumps(rows)
    checked = 0
    for row in rows:
        run = conevo.Run(row["run"])
        world = PursuitWorld(run.config.environment, run.config.world_params)
        rollout = Rollout(world, run.config.controller, n_threads=1)
        scenarios = world.scenarios([fold(run.config.run.seed, "lesion", k) for k in range(5)])
        genes, teams = run.champion.as_trial()
        labels = observe(run, 5, threads=1).labels
        for behaviour in BEHAVIOURS:
            modes = np.array([[0 if own == behaviour else -1 for own in labels]], dtype=np.int32)
            time = rollout.evaluate(genes, teams, scenarios, modes).performance["capture_time"]
            if behaviour in labels:
                assert row[behaviour] == pytest.approx(100 * time.mean() / row["capture_time"])
                checked += 1
            else:
                assert row[behaviour] is None
                assert time.mean() == pytest.approx(row["capture_time"])  # no predator was replaced
    assert checked >= 2


# --- command --------------------------------------------------------------------------------------


def say(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(words)
    return int(caught.value.code or 0), *capsys.readouterr()


def test_the_command_prints_the_contents_of_the_report(runs, capsys) -> None:
    words = ("behaviours", str(runs[3].path), "--scenarios", "3", "--threads", "1")
    code, out, err = say(capsys, *words)
    assert (code, err) == (0, "")
    code, text, err = say(capsys, *words, "--json")
    found = json.loads(text)
    report = {"run": str(runs[3].path)} | observe(runs[3], 3, threads=2).report
    assert found == json.loads(json.dumps(report))
    assert sum(found["captures"].values()) > 0
    for name, n in found["captures"].items():
        assert (f"{name} {n}" in out) == (n > 0)
    for k, life in enumerate(found["predators"]):
        line = next(line for line in out.splitlines() if line.startswith(f"predator {k}"))
        assert line.endswith(life["label"])
        assert [f"{share:.2f}" for share in life["shares"].values()] == line.split()[2:8]
    reproduced = out.split("held at")[1].splitlines()[2:]
    assert [line.split()[2] for line in reproduced] == [
        row["behaviour"] for row in found["reproduction"]
    ]


def test_the_command_draws_other_scenarios_with_another_seed(runs, capsys) -> None:
    words = ("behaviours", str(runs[3].path), "--scenarios", "3", "--json")
    one, other = (json.loads(say(capsys, *words, *seed)[1]) for seed in ((), ("--seed", "77")))
    assert (one["seed"], other["seed"]) == (SEEDS["homcne"][1], 77)
    assert one["predators"] != other["predators"]


def test_the_command_refuses_another_world_in_one_line(tmp_path, capsys) -> None:
    evolve_tiny(tmp_path / "rovers")
    code, out, err = say(capsys, "behaviours", str(tmp_path / "rovers"))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "is a run of rover-v2/complex-1" in err


def test_a_team_that_never_meets_anybody_still_has_a_report(tmp_path, capsys) -> None:
    settings: dict[str, Any] = TINY | SIZES["homcne"] | {"world.iterations": 5}
    conevo.evolve(
        "pursuit/team-1", "homcne", "smoke", 1, tmp_path / "run", overrides=settings, threads=1
    )
    code, out, err = say(capsys, "behaviours", str(tmp_path / "run"))
    assert (code, err) == (0, "")
    assert "Captures: none; most frequent: none" in out
    assert out.count("non-specialized") == 2
