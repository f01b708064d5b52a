"""Robot-steps per second of VMAS, MPE2 and conevo, on the same machine in the same hour.

Random actions, drawn before the clock starts; no network, no learning. Worlds of VMAS and MPE2 are
simpler than conevo's (a few discs with momentum), so this shows an order of magnitude, not which is
better. Robot-steps = environment steps x agents. ``simple_tag`` has the composition of
``pursuit/team-3``: four predators and one prey, all five counted; conevo's have random networks.
The script needs a separate environment (README.md in this folder). If conevo is not installed
there, only the others are measured.
"""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Callable
from importlib.util import find_spec

from machine import alternate, machine, spread, table

SCENARIOS: tuple[tuple[str, dict[str, int]], ...] = (
    ("simple_tag", {"num_adversaries": 4}),
    ("simple_spread", {}),
    ("discovery", {"n_agents": 20}),
)
SINGLE: tuple[tuple[str, dict[str, int]], ...] = (
    ("simple_tag", {"num_adversaries": 4}),
    ("simple_spread", {}),
)
OURS, N_PREY = "pursuit/team-3", 1


def vmas(scenario: str, extra: dict[str, int], batch: int, threads: int, seconds: float) -> Work:
    """Return a measurement of one VMAS scenario with ``batch`` parallel environments."""
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


def mpe2(scenario: str, extra: dict[str, int], seconds: float) -> Work:
    """Return a measurement of one MPE2 environment (it has no batches and uses one core)."""
    module = importlib.import_module(f"mpe2.{scenario}_v3")
    env = module.parallel_env(max_cycles=100, **extra)
    env.reset(seed=1)
    agents = list(env.agents)
    actions = [{a: env.action_space(a).sample() for a in agents} for _ in range(32)]

    def step(k: int) -> None:
        if not env.agents:
            env.reset()
        env.step(actions[k % 32])

    return (lambda: rate(step, seconds) * len(agents)), len(agents)


def ours(batch: int, threads: int) -> Work:
    """Return a measurement of conevo's predators with random networks: whole epochs of a batch."""
    from conevo.worlds.registry import world
    from conevo.worlds.rollout import Rollout
    from simulator import workload

    pursuit = world(OURS)
    team_steps = workload(pursuit, Rollout(pursuit, n_threads=threads), batch)
    team_steps()  # compiles
    n_agents = pursuit.n_robots + N_PREY
    return (lambda: team_steps() * n_agents), n_agents


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

    work: dict[tuple[str, str, int, int], Callable[[], float]] = {}
    n_agents: dict[tuple[str, str, int, int], int] = {}

    def add(name: tuple[str, str, int, int], measurement: Work) -> None:
        work[name], n_agents[name] = measurement

    for batch in options.batch:
        for threads in options.threads if find_spec("conevo") else ():
            add(("conevo", OURS, batch, threads), ours(batch, threads))
    for scenario, extra in SCENARIOS:
        for batch in options.batch:
            for threads in options.threads:
                measured = vmas(scenario, extra, batch, threads, options.seconds)
                add(("VMAS", scenario, batch, threads), measured)
    for scenario, extra in SINGLE:
        add(("MPE2", scenario, 1, 1), mpe2(scenario, extra, options.seconds))
    print(machine("conevo", "warp-lang", "vmas", "mpe2", "torch", "numpy"), "\n")
    results = alternate(work, options.repeats)

    print(f"random actions, {options.repeats} repeats in turns; thousands per second\n")
    rows = []
    for name, values in results.items():
        library, scenario, batch, threads = name
        rows.append([library, scenario, n_agents[name], batch, threads, *spread(values, digits=1)])
    head = ["simulator", "world", "agents", "batch", "threads", "robot-steps/s", "lowest - highest"]
    print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
