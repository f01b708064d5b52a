"""An exported file that drives a stepped world repeats the epoch that the kernels have recorded."""

from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.export.networks import KINDS
from conevo.worlds.stepper import Stepper
from export.replayed import kinds_for, recorded, step_of

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
TASKS = ("rover/complex-5", "pursuit/team-3", "prey/shaping-6", "gacc/complex-9", f"{LIGHT}:dark-1")


def drive(world, key, team, folder, ending):
    """Return observations [T, R, S] and outputs [T, R, O] of an epoch that a file drives."""
    stepper = Stepper(world, 1, [key], n_threads=1)
    stepper.reset(scenario=0)
    step, context = step_of(team, folder, ending), team.first_context
    observations, outputs = [], []
    for _ in range(world.params.iterations):
        observations.append(stepper.inputs.numpy()[0].copy())
        found, context = step(observations[-1], context)
        stepper.outputs.assign(found[None])
        stepper.step()
        outputs.append(found)
    return np.stack(observations), np.stack(outputs)


def moving(world, controller):
    """Return a key, and its recorded team and epoch, in which robots see something else in time."""
    for key in range(3, 20):
        team, observations, outputs = recorded(world, controller, key)
        if (observations[1:] != observations[:-1]).any():
            return key, team, observations, outputs
    pytest.fail("every team rests")


def assert_repeats(task, name, folder, endings, **params):
    world = conevo.world(task, **params)
    key, team, observations, outputs = moving(world, controller(name, world=world))
    for ending in endings:
        seen, found = drive(world, key, team, folder, ending)
        assert seen.tobytes() == observations.tobytes(), ending
        assert found.tobytes() == outputs.tobytes(), ending


@pytest.mark.parametrize("name", KINDS)
def test_a_file_repeats_an_epoch_of_its_own(name, tmp_path):
    assert_repeats("pursuit/team-3", name, tmp_path, [".py", ".h"], iterations=100)


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS, ids=lambda task: Path(task).name)
def test_a_file_repeats_an_epoch_in_every_world(task, tmp_path):
    """A whole one where all kinds of controllers play."""
    kinds = kinds_for(task)
    length = {} if len(kinds) > 1 else {"iterations": 300}
    for name in kinds:
        assert_repeats(task, name, tmp_path / name, [".py", ".onnx", ".h"], **length)
