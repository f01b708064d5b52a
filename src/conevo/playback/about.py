"""The description of a recorded epoch: the words and numbers kept with its channels."""

from __future__ import annotations

from typing import Any, NotRequired

from typing_extensions import TypedDict  # pydantic reads typing's own from Python 3.12 on only

__all__ = ["About"]


class About(TypedDict):
    """The description of a trajectory.

    label, run_id, method, seed: of the run. generation: in which the team was the fittest.
    epoch: number of the scenario among those that the seed draws; scenario: its key. labels [R]:
    caste of each robot in this epoch. specialization, fitness [R]: S and fitness in it. favourites,
    favourite_shares [R]: the setting that a robot used most in it, and its share of all settings
    used, "" and 0 if it used none; missing in earlier versions. heuristic [R]: name of a robot's
    heuristic controller, "" for its network. neurons [R]: slots in which a robot has hidden
    neurons. units: text after the values of each measure of performance, its unit and whether
    smaller is better; missing in conevo 0.1.0. controller: its name and settings. inputs, outputs:
    names of sensors and of controllers' outputs; missing in conevo 0.1.0. like: world of the
    package whose class the world's own inherits. drawn: the world's ``Drawn``.
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
