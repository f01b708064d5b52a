"""Who is a robot, what the other agents do, and the actions of agents, without any package."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.simulators.actions import Continuous, Discrete
from conevo.simulators.teams import Agent, Others, TeamFacts, actions_of, policy_in, team_of

NAMES = ("lead_0", "wolf_0", "sheep_0", "bird_0")
ENDS = np.array([-1, 0], np.float32), np.array([1, 2], np.float32)
AGENTS = tuple(map(Agent, NAMES, (4, 4, 2, 3), (5, 5, 5, ENDS)))
FACTS = TeamFacts("", 2, 4, actions_of(AGENTS[:2]), agents=AGENTS, team=(0, 1))
KEYS = np.arange(3, dtype=np.uint64) + 7
SEEN = np.arange(3 * 4 * 4, dtype=np.float32).reshape(3, 4, 4)
OWN = """
import numpy as np

def own(agent, observation, uniforms):
    if agent == "sheep_0":
        return observation.sum(axis=1).astype(int) % 5
    return 9 * uniforms
"""


def test_robots_are_selected_by_the_beginning_of_their_names() -> None:
    assert team_of(NAMES, "") == (0, 1, 2, 3)
    assert team_of(NAMES, "sheep , lead") == (0, 2)
    assert team_of(NAMES, "wolf_0") == (1,)
    with pytest.raises(UsageError, match=r"unknown agents 'wold' in world\.team; did you mean 'w"):
        team_of(NAMES, "wold, lead")


def test_others_at_random_choose_every_action_and_depend_on_key_and_iteration() -> None:
    drawn = [Others(FACTS, None, KEYS).of(t, SEEN) for t in range(60)]
    assert {tuple(one) for one in drawn} == {(2, 3)}
    chosen = np.stack([one[2] for one in drawn])  # [60, 3]
    axes = np.stack([one[3] for one in drawn])  # [60, 3, 2]
    assert all(set(column) == {0, 1, 2, 3, 4} for column in chosen.T.tolist())
    assert len({tuple(column) for column in chosen.T.tolist()}) == 3
    assert (axes.min(axis=(0, 1)) < ENDS[0] + 0.1).all()
    assert (axes.max(axis=(0, 1)) > ENDS[1] - 0.1).all()
    assert ((axes >= ENDS[0]) & (axes <= ENDS[1])).all()
    again = Others(FACTS, None, KEYS[::-1]).of(9, SEEN)
    assert again[2].tolist() == chosen[9, ::-1].tolist()
    assert again[3].tolist() == axes[9, ::-1].tolist()


def test_others_by_a_function_get_their_own_observations(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN)
    found = Others(FACTS, policy_in(f"{file}:own"), KEYS).of(0, SEEN)
    assert found[2].tolist() == (SEEN[:, 2, :2].sum(axis=1) % 5).tolist()  # it observes two numbers
    assert found[3].max() > 1
    assert ((found[3] >= ENDS[0]) & (found[3] <= ENDS[1])).all()  # clipped


def test_actions_have_numbers_or_axes_but_not_both() -> None:
    moves = actions_of([Agent("a", 1, 5), Agent("b", 1, 3)], moves=True)
    assert isinstance(moves, Discrete)
    assert (moves.outputs, moves.sizes.tolist()) == (
        ("stay", "left", "right", "down", "up"),
        [5, 3],
    )
    axes = actions_of([AGENTS[3], Agent("c", 1, (ENDS[0][:1], ENDS[1][:1]))])
    assert isinstance(axes, Continuous)
    assert axes.low.tolist() == [[-1, 0], [-1, 0]]
    assert axes.high.tolist() == [[1, 2], [1, 0]]
    assert axes.names == ("rest", "axis 0 up", "axis 0 down", "axis 1")
    with pytest.raises(UsageError, match=r"select agents by world\.team \(sheep_0, bird_0\)"):
        actions_of(AGENTS[2:])
