"""Train Q-learning robots for reference, with local or global rewards, in worlds of conevo.

    python experiments/reference_q.py --work runs/q [--tasks pursuit/team-3 rover/complex-5]
        [--reward local global] [--seeds 1 2 3] [--team-steps 2000000] [--set prey=heuristic]

Each robot learns its own action values (Watkins 1989), linear in its sensors, by epsilon-greedy
trials; chapter 2.2.1 of the thesis reviews such teams. A robot's reward is the growth of its own
fitness ("local"), or that of the whole team's ("global"): Balch 1999, Li, Martinoli and
Abu-Mostafa 2004. For each run ``--work`` gets TASK-REWARD-sSEED.json and .toml, evaluations during
the training in marl-eval's form and their description, as ``conevo report --foreign`` reads them,
and .npz, the action values. ``results.csv`` gets a row for each test in 256 scenarios that the
robots have not met: greedy, and with the last epsilon. A run that is in ``results.csv`` is not
repeated. It needs no other package.

Choice: a feature is a bin of a sensor, three of equal width between its bounds (-1 and 1 if it has
none), and one more is always 1. Features are 0 or 1, so this is a table for each sensor.
Choice: 16 teams play side by side and teach the same values: a step changes the values of an action
by the mean over the teams whose robot chose it, 0.1 of the error, divided among its features.
Choice: epsilon falls from 1 to 0.05 in the first half of the training, evenly. Discount 0.99; the
end of an epoch is an end, with no value after it. None of this was tuned for a task.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.adapters.teams import SteppedTeams
from conevo.errors import UsageError
from conevo.report.exhibits import slug
from conevo.report.marl_eval import Point, RawResult, to_json
from conevo.rng import fold, stream
from conevo.runs.provenance import describe_machine
from pages import Row, read, write

REWARDS = ("local", "global")
N_TEAMS, N_BINS = 16, 3
RATE, DISCOUNT, LAST_EPSILON = 0.1, 0.99, 0.05
N_EVALUATIONS, N_SCENARIOS, N_TESTS = 20, 32, 256
Doubles = npt.NDArray[np.float64]


@dataclass
class Learners:
    """Robots with action values that are linear in binary features of their sensors.

    Attributes:
        low, high: [S] ends of the sensors.
        values: [R, A, F] weights, F = S x bins + 1.
    """

    low: Doubles
    high: Doubles
    values: Doubles
    n_bins: int = field(default=N_BINS)

    @staticmethod
    def of(teams: SteppedTeams, n_bins: int = N_BINS) -> Learners:
        """Return learners for a world, whose values are 0."""
        low = np.where(np.isfinite(teams.low), teams.low, -1.0).astype(np.float64)
        high = np.where(np.isfinite(teams.high), teams.high, 1.0).astype(np.float64)
        shape = (len(teams.agents), len(teams.actions.names), len(low) * n_bins + 1)
        return Learners(low, high, np.zeros(shape), n_bins)

    def features(self, observations: npt.NDArray[Any]) -> Doubles:
        """Return the features [N, R, F] of observations [N, R, S]."""
        share = (observations - self.low) / (self.high - self.low)
        at = np.clip((share * self.n_bins).astype(int), 0, self.n_bins - 1)
        bins = (at[..., None] == np.arange(self.n_bins)).reshape(*at.shape[:2], -1)
        return np.concatenate([bins, np.ones((*at.shape[:2], 1))], axis=2)

    def q(self, features: Doubles) -> Doubles:
        """Return the values [N, R, A] of all actions."""
        return np.einsum("nrf,raf->nra", features, self.values)

    def choose(
        self, features: Doubles, epsilon: float, generator: np.random.Generator
    ) -> npt.NDArray[np.int64]:
        """Return actions [N, R]: the best, the first of equals, or with epsilon any."""
        q = self.q(features)
        anything = generator.integers(q.shape[2], size=q.shape[:2])
        is_trial = generator.random(q.shape[:2]) < epsilon
        return np.where(is_trial, anything, q.argmax(axis=2))

    def learn(
        self,
        before: Doubles,
        actions: npt.NDArray[np.int64],
        rewards: Doubles,
        after: Doubles | None,
    ) -> None:
        """Move the values of the chosen actions [N, R] towards rewards [N, R] and what follows.

        Args:
            before: [N, R, F] features in which they were chosen.
            actions: the chosen ones.
            rewards: of them.
            after: [N, R, F] features then; None at the end of an epoch.
        """
        target = rewards if after is None else rewards + DISCOUNT * self.q(after).max(axis=2)
        chosen = np.take_along_axis(self.q(before), actions[..., None], axis=2)[..., 0]
        of_action = actions[..., None] == np.arange(self.values.shape[1])
        errors = (target - chosen)[..., None] * of_action
        step = np.einsum("nra,nrf->raf", errors, before)
        counts = np.maximum(of_action.sum(axis=0), 1)
        self.values += RATE * step / (counts[..., None] * before[0, 0].sum())


def played(
    teams: SteppedTeams, learners: Learners, seed: int, epsilon: float
) -> dict[str, Doubles]:
    """Return return and performance [N] of teams that do not learn, each in its own scenario."""
    n = teams.stepper.n
    teams.reset(seed=seed)
    teams.stepper.reset(scenario=np.arange(n))
    generator, total = stream(seed, "trials"), np.zeros(n)
    for _ in range(teams.iterations):
        actions = learners.choose(learners.features(teams.observations), epsilon, generator)
        total += teams.step(actions).mean(axis=1)
    return {"return": total} | teams.performance()


def epoch(
    teams: SteppedTeams,
    learners: Learners,
    reward: str,
    epsilon: float,
    generator: np.random.Generator,
) -> None:
    """Let teams play one epoch and learn from it."""
    teams.reset()
    now = learners.features(teams.observations)
    for t in range(teams.iterations):
        actions = learners.choose(now, epsilon, generator)
        rewards = teams.step(actions)
        if reward == "global":
            rewards = np.broadcast_to(rewards.sum(axis=1, keepdims=True), rewards.shape)
        after = learners.features(teams.observations)
        learners.learn(now, actions, rewards, after if t + 1 < teams.iterations else None)
        now = after


def trained(
    task: str,
    reward: str,
    seed: int,
    team_steps: int,
    work: Path,
    params: dict[str, Any] | None = None,
    n_tests: int = N_TESTS,
) -> list[Row]:
    """Train the robots of a team, write the files of the run, and return a row for each test.

    Args:
        task: "pursuit/team-3".
        reward: one of ``REWARDS``.
        seed: of scenarios and trials.
        team_steps: the budget; it ends with a whole epoch of all teams.
        work: the directory of the files.
        params: parameters of the world that differ from their defaults.
        n_tests: number of scenarios of a test.

    Raises:
        UsageError: no such world or parameter, or a world without discrete actions.
    """
    params = params or {}

    def teams_of(n: int, scenarios: int) -> SteppedTeams:
        return SteppedTeams(task, n, "discrete", params, scenarios=scenarios, threads=1)

    teams, trials = teams_of(N_TEAMS, 1024), teams_of(N_SCENARIOS, N_SCENARIOS)
    learners, generator = Learners.of(teams), stream(seed, "q-learning", reward)
    begun, of_cpu = time.perf_counter(), time.process_time()
    teams.reset(seed=seed)
    n_epochs = max(1, round(team_steps / (N_TEAMS * teams.iterations)))
    every, points = max(1, n_epochs // N_EVALUATIONS), []
    for k in range(n_epochs):
        epsilon = max(LAST_EPSILON, 1 - 2 * (1 - LAST_EPSILON) * k / n_epochs)
        epoch(teams, learners, reward, epsilon, generator)
        if (k + 1) % every == 0 or k + 1 == n_epochs:
            found = played(trials, learners, fold(seed, "evaluation", k), 0.0)
            steps = (k + 1) * N_TEAMS * teams.iterations
            points.append(Point(f"step_{len(points) + 1}", steps, measured(found)))
    about: Row = {
        "task": task,
        "reward": reward,
        "seed": seed,
        "team-steps": n_epochs * N_TEAMS * teams.iterations,
        "robots": len(teams.agents),
        "seconds": time.perf_counter() - begun,
        "cpu seconds": time.process_time() - of_cpu,
        "load": os.getloadavg()[0],
        "parameters": learners.values[0].size,
        "actions": f"{learners.values.shape[1]} discrete",
    }
    rows, last = [], {}
    testers = teams_of(n_tests, n_tests)
    for policy, epsilon in (("greedy", 0.0), ("epsilon-greedy", LAST_EPSILON)):
        found = played(testers, learners, fold(seed, "test"), epsilon)
        row = about | {"policy": policy, "n": n_tests}
        for name, values in found.items():
            row |= {name: float(values.mean()), f"{name} se": float(values.std() / n_tests**0.5)}
        rows.append(row)
        last = last or measured(found)
    work.mkdir(parents=True, exist_ok=True)
    stem = f"{slug(task)}-{reward}-s{seed}"
    result = RawResult("conevo", slug(task), f"q-{reward}", f"seed_{seed}", tuple(points), last)
    (work / f"{stem}.json").write_text(json.dumps(to_json([result])) + "\n")
    (work / f"{stem}.toml").write_text(described(task, about))
    np.savez_compressed(work / f"{stem}.npz", values=learners.values)
    return rows


def measured(found: dict[str, Doubles]) -> dict[str, list[float]]:
    """Return the measures of performance, without the return, as a report takes them."""
    return {name: values.tolist() for name, values in found.items() if name != "return"}


def described(task: str, about: Row) -> str:
    """Return the description of a run for ``conevo report --foreign``."""
    stated = {
        "robots": about["robots"],
        "machine": f"one thread of {describe_machine('cpu')['cpu']}, load {about['load']:.1f}",
        "scenarios": f"{N_SCENARIOS} per evaluation, other than those of the training",
        "parameters": about["parameters"],
        "shared": False,
        "memory": "none",
        "actions": about["actions"],
        "policy": "deterministic",
        "seconds": round(about["seconds"], 1),
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in stated.items()]
    return "\n".join([*lines, "", "[tasks]", f"{slug(task)} = {json.dumps(task)}"]) + "\n"


def setting(text: str) -> tuple[str, Any]:
    """Return name and value of ``NAME=VALUE``; a value that is not JSON is text."""
    name, sign, value = text.partition("=")
    if not sign:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE")
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value


def main() -> int:
    """Train what is missing, and write ``results.csv`` after each run."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--tasks", nargs="+", default=["pursuit/team-3"])
    parser.add_argument("--reward", nargs="+", choices=REWARDS, default=list(REWARDS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--team-steps", type=int, default=2_000_000)
    parser.add_argument("--set", nargs="+", type=setting, default=[], metavar="NAME=VALUE")
    args = parser.parse_args()
    path = args.work / "results.csv"
    rows = read(path) if path.exists() else []
    for task in args.tasks:
        for reward in args.reward:
            for seed in args.seeds:
                key = (task, reward, seed)
                if any((row["task"], row["reward"], row["seed"]) == key for row in rows):
                    print(f"{task}, {reward}, seed {seed}: in {path}", flush=True)
                    continue
                try:
                    found = trained(task, reward, seed, args.team_steps, args.work, dict(args.set))
                except UsageError as error:
                    print(f"error: {error}", file=sys.stderr)
                    return error.exit_code
                rows += found
                write(rows, path)
                for row in found:
                    print(
                        f"{task}, {reward}, seed {seed}, {row['policy']}: return "
                        f"{row['return']:.4g} after {row['team-steps']:,} team-steps, "
                        f"{row['seconds']:.0f} s",
                        flush=True,
                    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
