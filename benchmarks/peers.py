"""Robot-steps per second of VMAS and MPE2, on this machine in the same hour.

Random actions, drawn before the clock starts; no network, no learning. Their worlds are simpler
than ours (a few discs with momentum), so this shows an order of magnitude and not who is better.
Robot-steps = environment steps x agents. Runs in an environment of its own, without conevo: see
README.md beside this file.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

from machine import alternate, machine, spread, table

SCENARIOS: tuple[tuple[str, dict[str, int]], ...] = (
    ("simple_tag", {}),
    ("simple_spread", {}),
    ("discovery", {"n_agents": 20}),
)


def vmas(scenario: str, extra: dict[str, int], batch: int, threads: int, seconds: float) -> Work:
    """Return a measurement of one VMAS scenario with ``batch`` environments side by side."""
    import torch
    from vmas import make_env

    env = make_env(scenario, num_envs=batch, device="cpu", continuous_actions=True, seed=1, **extra)
    env.reset()
    actions = [[env.get_random_action(agent) for agent in env.agents] for _ in range(32)]

    def measure() -> float:
        torch.set_num_threads(threads)
        env.reset()
        return rate(lambda k: env.step(actions[k % 32]), seconds) * batch * len(env.agents)

    return measure, len(env.agents)


def mpe2(scenario: str, seconds: float) -> Work:
    """Return a measurement of one MPE2 environment (it has no batches and uses one core)."""
    import importlib

    env = importlib.import_module(f"mpe2.{scenario}_v3").parallel_env(max_cycles=100)
    env.reset(seed=1)
    agents = list(env.agents)
    actions = [{a: env.action_space(a).sample() for a in agents} for _ in range(32)]

    def step(k: int) -> None:
        if not env.agents:
            env.reset()
        env.step(actions[k % 32])

    return (lambda: rate(step, seconds) * len(agents)), len(agents)


def rate(step: Callable[[int], object], seconds: float) -> float:
    """Return steps per second over ``seconds`` of wall time, after a short warm-up."""
    for k in range(5):
        step(k)
    began, count = time.perf_counter(), 0
    while (passed := time.perf_counter() - began) < seconds:
        step(count)
        count += 1
    return count / passed


Work = tuple[Callable[[], float], int]


def main() -> None:
    """Measure every scenario with every batch and number of threads, in turns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, nargs="+", default=[64, 512])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=3.0)
    options = parser.parse_args()

    work: dict[str, Callable[[], float]] = {}
    n_agents: dict[str, int] = {}
    for scenario, extra in SCENARIOS:
        for batch in options.batch:
            for threads in options.threads:
                name = f"VMAS {scenario} {batch} {threads}"
                work[name], n_agents[name] = vmas(scenario, extra, batch, threads, options.seconds)
    for scenario in ("simple_tag", "simple_spread"):
        name = f"MPE2 {scenario} 1 1"
        work[name], n_agents[name] = mpe2(scenario, options.seconds)
    print(machine("vmas", "mpe2", "torch", "numpy"), "\n")
    results = alternate(work, options.repeats)

    print(f"random actions, {options.repeats} repeats in turns; thousands per second\n")
    rows = []
    for name, values in results.items():
        library, scenario, batch, threads = name.split()
        n = n_agents[name]
        rows.append([library, scenario, n, batch, threads, *spread(values, digits=1)])
    head = ["simulator", "world", "agents", "batch", "threads", "robot-steps/s", "lowest - highest"]
    print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
