"""Environments as tasks of BenchMARL: names, configs, specs, learners, files of results."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.report.foreign import read_foreign
from conevo.worlds.registry import WORLDS
from extras import need

need("torch", "torchrl", "benchmarl")

import torch  # noqa: E402
from benchmarl.algorithms import IppoConfig, MappoConfig, MasacConfig  # noqa: E402
from benchmarl.experiment import Experiment, ExperimentConfig  # noqa: E402
from benchmarl.models.mlp import MlpConfig  # noqa: E402

from conevo.adapters.benchmarl import ConevoTask, task_of  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "experiments"))
LIGHT = f"{ROOT}/examples/light.py:dark-1"
SHORT = {"iterations": 20, "scenarios": 4}
BATCH = 160  # team-steps


def an_env(task: Any, n: int = 3, is_continuous: bool = False, seed: int = 0) -> Any:
    return task.get_env_fun(n, is_continuous, seed, "cpu")()


def an_experiment(task: Any, algorithm: Any, folder: Path, is_continuous: bool) -> Experiment:
    """Return an experiment of two batches."""
    config = ExperimentConfig.get_from_yaml()
    config.loggers, config.render, config.save_folder = [], False, str(folder)
    config.prefer_continuous_actions, config.max_n_frames = is_continuous, 2 * BATCH
    config.on_policy_n_envs_per_worker = config.off_policy_n_envs_per_worker = 8
    config.on_policy_collected_frames_per_batch = BATCH
    config.off_policy_collected_frames_per_batch = config.evaluation_interval = BATCH
    config.on_policy_minibatch_size, config.on_policy_n_minibatch_iters = 80, 2
    config.off_policy_n_optimizer_steps, config.off_policy_memory_size = 2, 1000
    config.evaluation_episodes = 3
    model = MlpConfig([16], layer_class=torch.nn.Linear, activation_class=torch.nn.Tanh)
    return Experiment(task, algorithm.get_from_yaml(), model, 0, config)


def test_every_environment_is_a_task_without_yaml() -> None:
    names = [f"{entry.short_name}/{one}" for entry in WORLDS.values() for one in entry.environments]
    assert [task.get_task().address for task in ConevoTask] == names
    assert ConevoTask.ROVER_COMPLEX_5.get_task().name == "ROVER_COMPLEX_5"
    assert ConevoTask.ROVER_COMPLEX_5.env_name() == "conevo"
    assert task_of("rover/complex-5") == ConevoTask.ROVER_COMPLEX_5.get_task()
    assert task_of(LIGHT).name == "LIGHT_DARK_1"


def test_the_config_has_parameters_of_the_world_and_of_the_teams() -> None:
    config = {"prey": "heuristic", "scenarios": 4, "scale": 0.5, "iterations": 30, "threads": 1}
    task = ConevoTask.PURSUIT_TEAM_3.get_task(config=config)
    env = an_env(task)
    assert env.teams.world.params.prey == "heuristic"
    assert len(env.teams.stepper.keys) == 4
    assert task.max_steps(env) == 30
    assert task.config == config
    assert task != ConevoTask.PURSUIT_TEAM_3.get_task()


@pytest.mark.parametrize(
    ("config", "line"),
    [
        ({"pray": "heuristic"}, "'world.pray'; did you mean 'world.prey'"),
        ({"iterations": 0}, "iterations"),
        ({"seed": 3}, "'seed' is chosen by BenchMARL's experiment"),
    ],
)
def test_bad_configs_are_one_line(config: dict[str, Any], line: str) -> None:
    with pytest.raises(UsageError, match=line) as error:
        ConevoTask.PURSUIT_TEAM_3.get_task(config)
    assert "\n" not in str(error.value)


def test_specs_are_those_of_one_team() -> None:
    task = ConevoTask.PURSUIT_TEAM_3.get_task(SHORT)
    for is_continuous, shape in ((False, (4,)), (True, (4, 2))):
        env = an_env(task, is_continuous=is_continuous)
        assert task.action_spec(env)["predators", "action"].shape == shape
        assert task.observation_spec(env)["predators", "observation"].shape == (4, 16)
        assert task.group_map(env) == {"predators": [f"predator_{i}" for i in range(4)]}
    assert task.supports_discrete_actions()
    assert not task_of(LIGHT).supports_discrete_actions()


def test_evaluations_meet_other_scenarios_than_the_training() -> None:
    task = ConevoTask.PURSUIT_TEAM_3.get_task(SHORT)

    def keys(n: int, seed: int) -> tuple[int, ...]:
        env = an_env(task, n, seed=seed)
        env.reset()
        found: tuple[int, ...] = env.teams.stepper.keys
        return found

    assert keys(8, 0) == keys(8, 0)
    assert not set(keys(8, 0)) & set(keys(3, 0))
    assert not set(keys(8, 0)) & set(keys(8, 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "algorithm", "is_continuous"),
    [
        ("PURSUIT_TEAM_3", MappoConfig, False),
        ("PURSUIT_TEAM_3", IppoConfig, True),
        ("PURSUIT_TEAM_3", MasacConfig, True),
        ("PURSUIT_TEAM_3", MasacConfig, False),
        ("ROVER_COMPLEX_5", MappoConfig, False),
    ],
)
def test_learners_run(name: str, algorithm: Any, is_continuous: bool, tmp_path: Path) -> None:
    """Policies change, all epochs end in time, and the file of results is read by the report."""
    made = an_experiment(ConevoTask[name].get_task(SHORT), algorithm, tmp_path, is_continuous)
    before = [one.clone() for one in made.policy.parameters()]
    made.run()
    assert made.continuous_actions == is_continuous
    assert made.total_frames == 2 * BATCH
    assert any(
        not torch.equal(*pair) for pair in zip(before, made.policy.parameters(), strict=True)
    )
    (file,) = tmp_path.rglob("*.json")
    (found, *_) = [one for one in read_foreign([file], "team") if one.measure == "return"]
    assert found.task == f"conevo/{name.lower()}"
    assert [steps for steps, _ in found.runs[0]] == [BATCH, 2 * BATCH]


@pytest.mark.slow
def test_the_script_of_references_writes_what_a_report_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import reference_marl

    monkeypatch.setattr(reference_marl, "BATCH", 640)
    one = reference_marl.reference("pursuit/team-3", SHORT | {"prey": "heuristic"})
    rows, returns = reference_marl.trained(one, 1, 1280, tmp_path, n_tests=4)
    assert [row["policy"] for row in rows] == ["stochastic", "deterministic"]
    assert all(row["team-steps"] == 1280 and row["robot-steps"] == 5120 for row in rows)
    assert all(row["return"] == row["capture_time"] for row in rows)
    assert len(returns) == 64  # 1280 / 20
    (found,) = read_foreign([tmp_path / "pursuit-team-3-s1.json"], "team")
    assert (found.is_measure, found.about["parameters"]) == ("capture_time", 5573)
    assert "pursuit-team-3" in found.names
    assert json.loads((tmp_path / "pursuit-team-3-s1.json").read_text())["conevo"]
    assert {one.suffix for one in tmp_path.iterdir()} == {".json", ".toml", ".pt"}


@pytest.mark.exhaustive
def test_mappo_learns_to_catch_heuristic_prey(tmp_path: Path) -> None:
    """Two million team-steps, about ten minutes; random predators reach about 20 of 1000."""
    import reference_marl

    one = reference_marl.reference("pursuit/team-3")
    _, returns = reference_marl.trained(one, 0, 2_000_000, tmp_path, n_tests=32)
    windows = np.array(returns[: len(returns) // 64 * 64]).reshape(-1, 64).mean(axis=1)
    assert np.sort(windows)[-3:].mean() >= 200
