"""Tasks of other packages, on a task made up for it: played, evolved, continued, drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.replay.playback import playback_of
from conevo.replay.recording import record
from conevo.rng import fold
from conevo.runs.config import resolve
from conevo.worlds.checks import findings, random_teams
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator
from runs.tiny import content
from simulators import toy

SMALL = {
    "run.epochs": 2, "run.fittest_epochs": 2, "run.n_tests": 3, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": 30, "method.genotypes": 6,
}  # fmt: skip
ZONES = """
def zone(observation, action):
    return (observation[:, 0] > 0).astype(int)

zone.names = ("left half", "right half")

def wrong(observation, action):
    return observation[:, 0]

wrong.names = ("all",)
nameless = abs
"""


@pytest.fixture(autouse=True)
def toys() -> Iterator[None]:
    with toy.known():
        yield


@pytest.fixture
def zones(tmp_path: Path) -> Path:
    file = tmp_path / "zones.py"
    file.write_text(ZONES)
    return file


def code_of(*arguments: str) -> int:
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return int(ended.value.code or 0)


def evolved(path: Path, generations: int, task: str = "toy:line", **more: Any) -> conevo.Run:
    settings = SMALL | {"run.generations": generations} | more
    return conevo.evolve(task, "cone", "smoke", out=path, overrides=settings, threads=1)


def played(task: str, heuristic: str, iterations: int = 30) -> Any:
    """Return the outcome of a team with a heuristic controller in five scenarios."""
    a_world = world(task, iterations=iterations)
    genes, teams = random_teams(a_world, 1)
    keys = [fold(3, "epoch", k) for k in range(5)]
    modes = np.full(teams.shape[:2], a_world.heuristics.index(heuristic), np.int32)
    made = simulator(a_world, conevo.controller(world=a_world))
    return made.evaluate(genes, teams, a_world.scenarios(keys), modes)


@pytest.mark.parametrize("task", ["line", "steps"])
def test_it_keeps_the_rules_of_a_world_with_its_own_simulator(task: str) -> None:
    found = [(one.topic, one.text) for one in findings(f"toy:{task}") if one.status == "problem"]
    assert found == []


@pytest.mark.parametrize("task", ["toy:line", "toy:steps", "toy:line.v3"])
def test_a_run_of_it_is_continued_bit_for_bit(task: str, tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", 5, task)
    short = evolved(tmp_path / "short", 2, task).resume(generations=5)
    one, other = content(whole.path), content(short.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])
    assert 'world = "toy:' in one["config"]
    assert whole.outline.task == task.replace(":", "/")


@pytest.mark.parametrize("task", ["toy:line", "toy:steps"])
def test_an_epoch_that_is_done_ends_and_costs_no_more(task: str) -> None:
    homing, nothing = played(task, "homing"), played(task, "nothing")
    assert (homing.steps < 12).all()
    assert (nothing.steps == 30).all()
    assert np.array_equal(homing.counts.sum(axis=-1), np.repeat(homing.steps[:, :, None], 2, 2))
    longer = played(task, "homing", 60)
    assert np.array_equal(longer.fitness, homing.fitness)  # nothing is added after the end
    assert np.array_equal(longer.performance["distance"], homing.performance["distance"])


@pytest.mark.parametrize("task", ["toy:line", "toy:steps"])
def test_all_teams_meet_the_same_scenarios_however_many_play_together(
    task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    a_world = world(task, iterations=30)
    genes, teams = random_teams(a_world, 9)
    made = simulator(a_world, conevo.controller(world=a_world))
    keys = [fold(3, "epoch", k) for k in range(8)]
    clones = made.evaluate(genes, np.repeat(teams[:1], 9, axis=0), a_world.scenarios(keys[:4]))
    assert np.ptp(clones.fitness, axis=0).max() == 0
    assert len(np.unique(clones.fitness[0], axis=0)) == 4
    rounds = a_world.scenarios(keys)  # two, of four epochs
    whole = made.evaluate(genes, teams[:8], rounds, rounds=2)
    for size in (1, 5, 7):
        monkeypatch.setattr("conevo.simulators.playing.MOST", size)
        parts = made.evaluate(genes, teams[:8], rounds, rounds=2)
        for name in ("fitness", "counts", "switches", "steps"):
            assert getattr(parts, name).tobytes() == getattr(whole, name).tobytes()


def test_the_budget_is_in_team_evaluations_and_early_ends_save_none(tmp_path: Path) -> None:
    """A team that has reached the middle costs fewer team-steps, but as many evaluations."""
    small, large = (
        evolved(tmp_path / str(n), 50, **{"run.budget_evaluations": 400, "world.iterations": n})
        for n in (15, 150)
    )
    for run in (small, large):
        assert run.provenance["stopped_by"] == "budget"
        last = run.generations()[-1]
        assert 300 < last["team_evaluations"] <= 400
    evaluations = [[one["team_evaluations"] for one in run.generations()] for run in (small, large)]
    assert evaluations[0][:2] == evaluations[1][:2]
    steps = [run.generations()[-1]["team_steps"] for run in (small, large)]
    assert steps[0] < steps[1] < 10 * steps[0]


def test_team_steps_are_those_that_were_played(tmp_path: Path) -> None:
    run = evolved(tmp_path / "run", 3)
    whole = [one["team_evaluations"] * 2 * 30 for one in run.generations()]
    steps = [one["team_steps"] for one in run.generations()]
    assert all(0 < played < most for played, most in zip(steps, whole, strict=True))
    assert steps == sorted(steps)


def test_rewards_are_fitness_and_their_mean_is_the_performance() -> None:
    out = played("toy:line", "homing")
    assert out.performance["reward"] == pytest.approx(out.fitness.mean(axis=2))
    assert (out.fitness <= 0).all()
    assert (out.fitness.mean(axis=(1, 2)) < 0).all()
    assert list(out.performance) == ["reward", "distance"]


def test_an_epoch_is_recorded_to_its_end_and_drawn(tmp_path: Path) -> None:
    a_world = world("toy:line", iterations=30)
    genes, teams = random_teams(a_world, 1)
    made = simulator(a_world, conevo.controller(world=a_world))
    modes = np.full(teams.shape[1:2], a_world.heuristics.index("homing"), np.int32)
    seen = made.record(genes, teams[0], a_world.scenarios([7]), modes)
    out = made.evaluate(genes, teams, a_world.scenarios([7]), modes[None])
    end = int(out.steps[0, 0])
    assert (seen["action"][:end] >= 0).all()
    assert (seen["action"][end:] == -1).all()
    assert (seen["x"][end:] == seen["x"][end - 1]).all()
    assert seen["fitness"][-1].tolist() == out.fitness[0, 0].tolist()
    drawn = playback_of(record(evolved(tmp_path / "run", 1)))
    assert [things.name for things in drawn.things] == ["middle"]


def test_the_command_line_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "run")
    sets = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    options = ("--set", "world.options={n_agents = 3}")
    assert code_of("run", "toy:line", *sets, *options, "--preset", "smoke", "--out", out) == 0
    assert 'options = "n_agents = 3"' in (Path(out) / "config.toml").read_text()
    for command in (("show",), ("test", "--scenarios", "2"), ("list", "settings", "toy:line")):
        place = [] if command[0] == "list" else [out]
        assert code_of(command[0], *place, *command[1:]) == 0
    assert "toy/line, CONE" in capsys.readouterr().out
    assert code_of("test", out, "--scenarios", "2", "--set", "world.iterations=5") == 0
    assert code_of("signal", "toy:line", "--preset", "smoke", "--units", "4", "--trials", "2") == 0
    capsys.readouterr()
    assert code_of("list", "worlds") == 0
    assert "vmas:TASK, toy:TASK" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ("toy:lin", "unknown task 'lin' of toy; did you mean 'line'?"),
        ("tyo:line", "unknown family of tasks 'tyo'; did you mean 'toy'?"),
        ("toy/line", "world 'toy/line': a task of toy is named toy:line"),
        ("far:line", "a task of another package"),
    ],
)
def test_an_unknown_task_is_refused_in_one_line(
    task: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert code_of("run", task, "--out", str(tmp_path / "run")) == 2
    out, error = capsys.readouterr()
    assert words in error
    assert (out, error.count("\n")) == ("", 1)
    assert not (tmp_path / "run").exists()


def test_a_run_is_not_continued_with_another_version_of_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = evolved(tmp_path / "run", 2)
    assert run.provenance["kernel_hash"].startswith("toy 1.0: line ")
    monkeypatch.setattr(toy, "VERSION", ["toy 1.1"])
    with pytest.raises(UsageError, match=r"was made with toy 1\.0: line .*, and here is toy 1\.1"):
        conevo.Run(run.path).resume(generations=3)


def test_options_have_one_spelling() -> None:
    written = ("n_agents=3", "{ n_agents = 3 }", {"n_agents": 3})
    found = {resolve("toy:line", overrides={"world.options": one}).run_id for one in written}
    assert len(found) == 1
    made = resolve("toy:line", overrides={"world.options": {"names": ["a", 'b"'], "is": True}})
    assert made.world_params.options == 'is = true, names = ["a", "b\\""]'
    assert made.world_params.keywords == {"names": ["a", 'b"'], "is": True}
    for wrong in ("n_agents", "n_agents = 3}\nother = {"):
        with pytest.raises(UsageError, match=r"world.options = 'n_agents.*must be keyword argum"):
            resolve("toy:line", overrides={"world.options": wrong})


def test_a_users_function_labels_actions(zones: Path, tmp_path: Path) -> None:
    run = evolved(tmp_path / "run", 2, **{"world.labels": f"{zones}:zone"})
    assert run.provenance["world"]["castes"] == ["left half", "right half"]
    assert 'labels = "inputs/zones.py:zone"' in (run.path / "config.toml").read_text()
    zones.unlink()  # the run has a copy
    moved = run.path.rename(tmp_path / "moved")
    assert conevo.Run(moved).resume(generations=3).status == "finished"
    kept = moved / "inputs" / "zones.py"
    kept.write_text(ZONES.replace("> 0", "> 1"))
    with pytest.raises(UsageError, match=r"zones\.py has changed"):
        conevo.Run(moved).resume(generations=4)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("zonne", "unknown function 'zonne' in .*did you mean 'zone'"),
        ("nameless", "needs the names of its labels: nameless.names"),
        ("wrong", r"wrong must return \d+ whole numbers, one for each robot, not float32"),
    ],
)
def test_a_wrong_function_is_refused(name: str, words: str, zones: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=words):
        evolved(tmp_path / "run", 1, **{"world.labels": f"{zones}:{name}"})
    with pytest.raises(UsageError, match=r"unknown labels 'action'.*did you mean 'actions'"):
        evolved(tmp_path / "run", 1, **{"world.labels": "action"})


def test_the_constant_input_is_a_setting() -> None:
    assert world("toy:line").inputs == ("observation 0", "observation 1", "constant")
    assert world("toy:line", constant_input=False).inputs == ("observation 0", "observation 1")
    assert resolve("toy:line").controller.weight_scale == 3.0


def test_epochs_of_a_difference_in_credit_count_too(tmp_path: Path) -> None:
    """Each team is played once more for each robot, and each time an epoch may end early."""
    plain, difference = (
        evolved(tmp_path / credit, 1, **{"run.credit": credit, "world.iterations": 100})
        for credit in ("robot", "difference")
    )
    own, more = (run.generations()[0]["team_steps"] for run in (plain, difference))
    evaluations = difference.generations()[0]["team_evaluations"]
    assert 2 * own < more < evaluations * 2 * 100
