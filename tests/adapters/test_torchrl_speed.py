"""Speed of TorchRL's ``env.step`` on a batch of teams, alone and against its PettingZoo wrapper.

It is measured in the processor's time, on one thread, so that other work on the machine matters
less.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import process_time
from typing import Any

import pytest

from extras import need

need("torch", "torchrl", "pettingzoo")

import torch  # noqa: E402
from torchrl.envs.libs.pettingzoo import PettingZooWrapper  # noqa: E402

import conevo  # noqa: E402

pytestmark = pytest.mark.timing


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def team_steps_per_second(env: Any, n: int, seconds: float = 0.5, tries: int = 5) -> float:
    """Return the highest of several measurements."""
    actions = [env.full_action_spec.rand() for _ in range(8)]
    seen, best, count = env.reset(), 0.0, 0
    for _ in range(tries):
        steps, start = 0, process_time()
        while (now := process_time()) - start < seconds:
            seen = env.step(seen.update(actions[count % 8]))["next"]
            count, steps = count + 1, steps + 1
            if seen["done"].any():
                seen = env.reset()
        best = max(best, steps * n / (now - start))
    return best


@pytest.mark.parametrize(("task", "least"), [("pursuit/team-3", 4e5), ("rover/complex-5", 8e4)])
def test_steps_of_512_teams(task: str, least: float) -> None:
    env = conevo.adapters.torchrl.TeamBatchEnv(task, 512, threads=1)
    assert team_steps_per_second(env, 512) >= least


def test_it_is_a_hundred_times_as_fast_as_the_wrapper_of_pettingzoo() -> None:
    batch = conevo.adapters.torchrl.TeamBatchEnv("pursuit/team-3", 512, threads=1)
    wrapped = PettingZooWrapper(
        conevo.adapters.pettingzoo.parallel_env("pursuit/team-3"),
        return_state=False,
        use_mask=False,
        categorical_actions=True,
    )
    ours, theirs = team_steps_per_second(batch, 512), team_steps_per_second(wrapped, 1)
    assert ours >= 100 * theirs
