"""What a recorded epoch is of: the words and numbers kept with its channels."""

from __future__ import annotations

from typing import Any, NotRequired

from typing_extensions import TypedDict  # pydantic reads typing's own from Python 3.12 on only

__all__ = ["About"]


class About(TypedDict):
    """What a trajectory is of.

    label, run_id, method, seed: of the run. generation: in which the team was the fittest one.
    epoch: number of the scenario among those that the seed draws; scenario: its key. labels [R]:
    caste of each robot in this epoch. specialization, fitness [R]: S and fitness in it. favourites,
    favourite_shares [R]: the setting that a robot used most in it and its share of all that it
    used, "" and 0 if it used none; earlier versions wrote none. heuristic [R]: name of a robot's
    heuristic controller, "" for its network. neurons [R]: slots in which a robot has hidden
    neurons. units: what follows a value of each measure of performance, its unit and that smaller
    is better if it is; conevo 0.1.0 wrote none. controller: its name and settings. inputs, outputs:
    names of what robots sense and of what their controllers give; conevo 0.1.0 wrote none. like:
    world of the package whose class the world's own inherits. drawn: what it says is drawn.
    """

    format: int
    conevo: str
    kernel_hash: str
    world: str
    environment: str
    task: str
    method: str
    label: str
    run_id: str
    seed: int
    generation: int
    epoch: int
    scenario: int
    iterations: int
    n_robots: int
    params: dict[str, bool | int | float | str]
    controller: dict[str, bool | int | float | str]
    inputs: NotRequired[list[str]]
    outputs: NotRequired[list[str]]
    actions: list[str]
    castes: list[str]
    labels: list[str]
    specialization: list[float]
    favourites: NotRequired[list[str]]
    favourite_shares: NotRequired[list[float]]
    fitness: list[float]
    heuristic: list[str]
    neurons: list[list[int]]
    performance: dict[str, float]
    units: NotRequired[dict[str, str]]
    like: NotRequired[str]
    drawn: NotRequired[dict[str, Any]]
