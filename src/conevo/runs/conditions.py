"""A champion under other conditions: another environment, other settings, more or fewer robots.

Or with each controller in another robot: robots of one caste can replace each other, those of
different castes cannot. This also finds castes with the same actions at different places, which the
degree of specialization does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from conevo.errors import UsageError, unknown_name
from conevo.runs.ancestry import refuse_other_controllers
from conevo.runs.champions import Team
from conevo.runs.config import RunConfig, resolve
from conevo.runs.lab import Lab
from conevo.runs.provenance import device_of
from conevo.runs.testing import test_team
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["test_under"]


def test_under(
    run: Run,
    on: str | None,
    world: Mapping[str, Any],
    robots: int | None,
    rotate: int,
    scenarios: int | None,
    seed: int | None,
    threads: int | None,
    device: str | None,
) -> Record:
    """Test a run's champion in its own world and under changed conditions; writes nothing.

    Choice: in the same world the run's settings hold unless they are changed; another environment
    has its own where the defaults of the two differ, and another world all of the run's preset. The
    controllers are the run's. A smaller team is of the first
    controllers, a larger one repeats them from the first on. Then robot r gets the
    controller of robot r - ``rotate``, and the first robots those of the last ones.

    Returns:
        The results of both, "own" and "changed", as ``Run.test`` gives them; "conditions": the
        task, the robots, the settings that were changed, ``rotate``, and whether all controllers
        are equal ("clones"); "change": the difference of the means of each measure that both have,
        None if one is not finite.

    Raises:
        UsageError: a name or value that is not allowed, or the team cannot play there.
    """
    config = _changed(run.config, on, world, robots)
    refuse_other_controllers(str(run.path), run.config, config)
    lab = Lab.equip(config, threads, device_of(run.provenance, device))
    _refuse_rotation(rotate, lab.world.n_robots)
    own = run.test(scenarios, seed, threads=threads, device=device)
    champion = run.champion
    if champion is None:
        raise RuntimeError("a tested run has a champion")
    changed = test_team(
        lab.simulator,
        lab.world,
        _placed(champion, lab.world.n_robots, rotate),
        n_scenarios=own["scenarios"],
        seed=own["seed"],
    )
    conditions = {
        "task": config.task,
        "robots": lab.world.n_robots,
        "settings": dict(world),
        "rotate": rotate,
        "clones": bool((champion.genes == champion.genes[0]).all()),
    }
    means = {name: value["mean"] for name, value in own["performance"].items()}
    now = {name: value["mean"] for name, value in changed["performance"].items()}
    change = {
        name: None if means[name] is None or now[name] is None else now[name] - means[name]
        for name in means
        if name in now
    }
    return {"own": own, "changed": changed, "conditions": conditions, "change": change}


def _changed(
    config: RunConfig, on: str | None, world: Mapping[str, Any], robots: int | None
) -> RunConfig:
    """Return the configuration with another environment and other settings of the world."""
    address = config.address if on is None else on
    if on is not None and "/" not in on and ":" not in on:
        address = config.entry.address(on)
    there = resolve(address, config.method_entry.address, config.preset)
    known = [field.name for field in fields(there.world_params)]
    settings = {}
    if there.world == config.world:
        own, other = (one.entry.defaults.get(one.environment, {}) for one in (config, there))
        settings = {
            f"world.{key}": value
            for key, value in config.tables()["world"].items()
            if (key in own, own.get(key)) == (key in other, other.get(key))
        }
    given: set[str] = set()
    for key, value in world.items():
        name = key.removeprefix("world.")
        if name not in known:
            raise unknown_name(
                "key", key, [f"world.{one}" for one in known], "(only the world can be changed)"
            )
        if name in given or (name == "n_robots" and robots is not None):
            raise UsageError(f"world.{name} is set twice; give it once")
        given.add(name)
        settings[f"world.{name}"] = value
        if f"{name}_digest" in known:
            settings[f"world.{name}_digest"] = ""  # of the former value
    if robots is not None:
        if "n_robots" in known:
            settings["world.n_robots"] = robots
        elif robots != there.build_world().n_robots:
            raise UsageError(
                f"--robots {robots}: teams of {there.task} have {there.build_world().n_robots}, "
                f"which no setting changes; another environment may have others: --on ENVIRONMENT"
            )
    seed, place = config.run.seed, "of the changed conditions"
    changed = resolve(
        address,
        config.method_entry.address,
        config.preset,
        seed,
        overrides=settings,
        place=place,
    )
    return replace(changed, controller=config.controller)


def _refuse_rotation(rotate: int, n_robots: int) -> None:
    if type(rotate) is not int or not 0 <= rotate < n_robots:
        if n_robots == 1:
            raise UsageError(f"rotate = {rotate!r}: a team of one robot has nothing to rotate")
        raise UsageError(
            f"rotate = {rotate!r}: must be a whole number from 1 to {n_robots - 1}, less than the "
            f"number of robots, {n_robots}"
        )


def _placed(team: Team, n_robots: int, rotate: int) -> Team:
    """Return a team of another size: the first controllers, or all of them repeated, rotated."""
    robot = np.roll(np.arange(n_robots) % len(team.genes), rotate)
    return replace(
        team,
        genes=team.genes[robot],
        active=team.active[robot],
        fitness=team.fitness[robot],
        specialization=team.specialization[robot],
    )
