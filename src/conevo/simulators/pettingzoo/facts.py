"""The facts about a PettingZoo task, which a worker process finds."""

from __future__ import annotations

import functools

from conevo.errors import UsageError
from conevo.simulators.particles import drawn_of
from conevo.simulators.pettingzoo import episodes
from conevo.simulators.pettingzoo.workers import ask_all, workers
from conevo.simulators.teams import Agent, TeamFacts, actions_of, team_of

__all__ = ["facts_of"]


@functools.lru_cache(maxsize=32)
def facts_of(task: str, options: str, prefixes: str, versions: str) -> TeamFacts:
    """Return the facts about a task.

    Args:
        task: the module with its environment.
        options: its keyword arguments, as a TOML table.
        prefixes: first letters of the names of robots.
        versions: of the packages that simulate it.

    Raises:
        UsageError: the task cannot be made with these options, or cannot be played.
    """
    (found,) = ask_all(f"pettingzoo:{task}", episodes.find, [(workers(1)[0], (task, options))])
    agents = tuple(Agent(*one) for one in found.agents)
    team = team_of([agent.name for agent in agents], prefixes)
    robots = [agents[k] for k in team]
    if not max(robot.n_inputs for robot in robots):
        raise UsageError(f"the robots of pettingzoo:{task} observe nothing")
    return TeamFacts(
        versions=versions,
        n_robots=len(robots),
        n_inputs=max(robot.n_inputs for robot in robots),
        actions=actions_of(robots, moves=task.startswith("mpe2.")),
        drawn=None if found.look is None else drawn_of(found.look, team),
        agents=agents,
        team=team,
    )
