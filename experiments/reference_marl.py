"""Train MAPPO by BenchMARL for reference: in worlds of conevo, and in VMAS as it is.

    python experiments/reference_marl.py --work runs/mappo [--seeds 1 2 3] [--team-steps 2000000]
        [--tasks pursuit/team-3 vmas:balance vmas:dispersion vmas:discovery]

trains a policy for every task and seed until its team-steps are spent. Then it tests the policy in
256 scenarios that it has not met, with actions drawn from it and with its most probable ones. It
needs ``pip install 'conevo[benchmarl,vmas]'``. For each run ``--work`` gets

- TASK-sSEED.json and .toml, evaluations during the training in marl-eval's form and their
  description, both as ``conevo report --foreign`` reads them;
- TASK-sSEED.pt, the policy,

and ``results.csv`` gets a row for each test: team-steps, seconds (wall clock and of the processor,
with all evaluations), return, performance, and standard errors. A run that is in ``results.csv`` is
not repeated. A run uses one thread; 2 million team-steps of pursuit/team-3 take about ten minutes.

Choice: actor and critic have two hidden layers of 64 tanh units. The robots share the actor, which
gets the sensors of one robot. Each batch of 16,000 team-steps serves for eight passes in
minibatches of 4,000. Learning rate 3e-4, discount 0.99, entropy coefficient 0.01, everything else
as in BenchMARL. None of this was tuned for a task. Prey are heuristic: a random team catches shaped
prey in two or three of a hundred epochs, which is too rare to learn from.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from benchmarl.algorithms import MappoConfig
from benchmarl.environments import VmasTask
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torchrl.envs.utils import ExplorationType, set_exploration_type

from conevo.adapters.benchmarl import task_of
from conevo.rng import fold
from conevo.runs.provenance import describe_machine
from pages import Row, read, write

TASKS = ("pursuit/team-3", "vmas:balance", "vmas:dispersion", "vmas:discovery")
CONFIGS = {"pursuit/team-3": {"prey": "heuristic"}}
BATCH = 16_000  # team-steps
VMAS_STEPS = 100  # of an epoch, as in ``conevo run vmas:TASK``
N_TESTS = 256
POLICIES = {
    "stochastic": ExplorationType.RANDOM,
    "deterministic": ExplorationType.DETERMINISTIC,
}


@dataclass(frozen=True)
class Reference:
    """How a task is trained.

    Attributes:
        name: "pursuit/team-3" or "vmas:balance".
        task: as BenchMARL knows it.
        is_continuous: whether the actions are.
        n_envs: environments side by side.
        measure: what a return is in conevo's reports.
    """

    name: str
    task: Any
    is_continuous: bool
    n_envs: int
    measure: str


class Returns(Callback):
    """Keeps the returns of the epochs that end in the training, in their order."""

    def __init__(self) -> None:
        super().__init__()
        self.of_epochs: list[float] = []

    def on_batch_collected(self, batch: Any) -> None:
        """Add the mean returns of robots in the epochs that end in a batch."""
        (group,) = self.experiment.group_map
        ended = batch["next", "done"][..., 0]
        returns = batch["next", group, "episode_reward"].mean(dim=(-2, -1))
        self.of_epochs += returns.T[ended.T].tolist()  # [envs, steps] in order of time


def reference(name: str, config: dict[str, Any] | None = None) -> Reference:
    """Return how a task is trained.

    Args:
        name: one of VMAS is "vmas:TASK".
        config: parameters of a world of conevo, in place of those of ``CONFIGS``.

    Raises:
        SystemExit: VMAS has no such scenario.
    """
    family, _, scenario = name.partition(":")
    if family != "vmas":
        task = task_of(name, CONFIGS.get(name, {}) if config is None else config)
        return Reference(name, task, False, 64, "capture_time" if "pursuit" in name else "return")
    if scenario.upper() not in VmasTask.__members__:
        raise SystemExit(f"{name}: BenchMARL has no such scenario of VMAS")
    task = VmasTask[scenario.upper()].get_task({"max_steps": VMAS_STEPS})
    return Reference(name, task, True, BATCH // VMAS_STEPS, "reward")


def experiment(
    one: Reference, seed: int, team_steps: int, folder: Path, returns: Returns
) -> Experiment:
    """Return BenchMARL's experiment, which keeps its files in a folder."""
    config = ExperimentConfig.get_from_yaml()
    config.loggers, config.create_json, config.render = [], True, False
    config.save_folder = str(folder)
    config.prefer_continuous_actions = one.is_continuous
    config.max_n_frames = team_steps
    config.lr, config.gamma = 3e-4, 0.99
    config.on_policy_n_envs_per_worker = one.n_envs
    config.on_policy_collected_frames_per_batch = BATCH
    config.on_policy_minibatch_size, config.on_policy_n_minibatch_iters = 4_000, 8
    config.evaluation, config.evaluation_interval = True, 10 * BATCH
    config.evaluation_episodes, config.evaluation_deterministic_actions = 32, False
    algorithm = MappoConfig.get_from_yaml()
    algorithm.entropy_coef = 0.01
    model = MlpConfig([64, 64], layer_class=torch.nn.Linear, activation_class=torch.nn.Tanh)
    return Experiment(
        task=one.task,
        algorithm_config=algorithm,
        model_config=model,
        critic_model_config=model,
        seed=seed,
        config=config,
        callbacks=[returns],
    )


@torch.no_grad()
def tested(one: Reference, policy: Any, how: str, seed: int, n: int) -> Row:
    """Return the means of return and performance in n scenarios, with standard errors."""
    env = one.task.get_env_fun(n, one.is_continuous, fold(seed, "test") % 2**31, "cpu")()
    (group,) = one.task.group_map(env)
    returns, is_on = torch.zeros(n), torch.ones(n, dtype=torch.bool)
    with set_exploration_type(POLICIES[how]):
        seen = env.reset()
        for _ in range(one.task.max_steps(env)):
            seen = env.step(policy(seen))["next"]
            returns += torch.where(is_on, seen[group, "reward"].mean(dim=(-2, -1)), 0.0)
            is_on &= ~seen["done"][:, 0]
    found = {"return": returns}
    if hasattr(env, "teams"):  # of conevo
        found |= {k: torch.from_numpy(v) for k, v in env.teams.performance().items()}
    env.close()
    row: Row = {}
    for name, values in found.items():
        row |= {name: float(values.mean()), f"{name} se": float(values.std() / n**0.5)}
    return row


def trained(
    one: Reference, seed: int, team_steps: int, work: Path, n_tests: int = N_TESTS
) -> tuple[list[Row], list[float]]:
    """Train a policy, write its files, and return a row for each test.

    Args:
        one: the task.
        seed: of networks, draws and scenarios.
        team_steps: the budget; it ends with a whole batch.
        work: the directory of the files.
        n_tests: number of scenarios of a test.

    Returns:
        Rows, and the returns of the epochs of the training in their order.
    """
    torch.set_num_threads(1)
    stem = f"{one.name.replace('/', '-').replace(':', '-')}-s{seed}"
    folder, returns = work / f"{stem}.benchmarl", Returns()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    begun = time.perf_counter(), time.process_time()
    training = experiment(one, seed, team_steps, folder, returns)
    training.run()
    seconds, of_cpu = time.perf_counter() - begun[0], time.process_time() - begun[1]
    ((group, robots),) = training.group_map.items()
    actor = training.losses[group].actor_network_params
    about: Row = {
        "task": one.name,
        "seed": seed,
        "team-steps": training.total_frames,
        "robot-steps": training.total_frames * len(robots),
        "robots": len(robots),
        "seconds": seconds,
        "cpu seconds": of_cpu,
        "load": os.getloadavg()[0],
        "parameters": sum(values.numel() for values in actor.flatten_keys().values()),
    }
    rows = [
        about | {"policy": how, "n": n_tests} | tested(one, training.policy, how, seed, n_tests)
        for how in POLICIES
    ]
    torch.save(training.policy.state_dict(), work / f"{stem}.pt")
    (written,) = folder.rglob("*.json")
    (work / f"{stem}.toml").write_text(described(one, about))
    shutil.copyfile(written, work / f"{stem}.json")
    shutil.rmtree(folder)
    return rows, returns.of_epochs


def described(one: Reference, about: Row) -> str:
    """Return the description of a run for ``conevo report --foreign``."""
    machine = describe_machine("cpu")
    name = one.task.name.lower()
    actions = "continuous" if one.is_continuous else "discrete"
    stated = {
        "robots": about["robots"],
        "machine": f"one thread of {machine['cpu']}, load {about['load']:.1f}",
        "scenarios": "32 per evaluation, other than those of the training",
        "parameters": about["parameters"],
        "shared": True,
        "memory": "none",
        "actions": actions,
        "policy": "stochastic",
        "seconds": round(about["seconds"], 1),
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in stated.items()]
    lines += ["", "[tasks]", f"{name} = {json.dumps(one.name)}"]
    if one.measure != "return":
        lines += ["", "[measures]", f"return = {json.dumps(one.measure)}"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Train what is missing, and write ``results.csv`` after each run."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--tasks", nargs="+", default=list(TASKS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--team-steps", type=int, default=2_000_000)
    args = parser.parse_args()
    references = [reference(name) for name in args.tasks]
    args.work.mkdir(parents=True, exist_ok=True)
    path = args.work / "results.csv"
    rows = read(path) if path.exists() else []
    for one in references:
        for seed in args.seeds:
            if any((row["task"], row["seed"]) == (one.name, seed) for row in rows):
                print(f"{one.name}, seed {seed}: in {path}", flush=True)
                continue
            found, _ = trained(one, seed, args.team_steps, args.work)
            rows += found
            write(rows, path)
            for row in found:
                print(
                    f"{one.name}, seed {seed}, {row['policy']}: return {row['return']:.4g} after "
                    f"{row['team-steps']:,} team-steps, {row['seconds']:.0f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
