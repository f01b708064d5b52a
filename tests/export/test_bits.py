"""Exported teams give the kernels' outputs bit for bit, in every world and format.

Whole epochs: ``test_closed_loop.py``.
"""

import functools
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import CONTROLLERS, controller
from conevo.export.files import FORMATS
from conevo.export.networks import KINDS
from export.replayed import kinds_for, played, recorded, step_of

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
TASKS = [f"{one.short_name}/{one.environments[-1]}" for one in conevo.WORLDS.values()]
TASKS += [f"{LIGHT}:dark-1"]
SHORT = 30  # iterations
# Settings that the worlds do not suggest: without context, the largest, other scales.
OTHERS = {
    "srn": ({"n_hidden": 3, "max_hidden": 3, "recurrent": False},
            {"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5, "bias": True}),
    "ctrnn": ({"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5, "slowest": 1.0},),
    "gru": ({"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5},),
    "thresholds": ({"stimulus": "input", "theta": 0.3, "steepness": 3, "gain": 16.0},),
}  # fmt: skip
CASES = [
    pytest.param(
        task,
        name,
        id=f"{Path(task).name}-{name}",
        marks=[] if name in kinds_for(task) else [pytest.mark.exhaustive],
    )
    for task in TASKS
    for name in KINDS
]


@functools.cache
def epoch(task, name, iterations, settings=()):
    """Return a team, its observations and its outputs."""
    world = conevo.world(task, **({"iterations": iterations} if iterations else {}))
    return recorded(world, controller(name, world=world, **dict(settings)))


def assert_bits(case, folder, ending):
    team, observations, outputs = case
    found = played(step_of(team, folder, ending), team, observations)
    assert found.shape == outputs.shape
    different = np.flatnonzero((found.view("i4") != outputs.view("i4")).any(axis=(1, 2)))
    assert different.size == 0, f"from iteration {different[0]} of {len(outputs)}"
    assert np.ptp(outputs[:, 1:], axis=(0, 1)).all()  # not all the same number


def test_the_controllers_of_the_package_are_exported():
    assert set(CONTROLLERS) >= set(KINDS) == set(OTHERS) == {"srn", "ctrnn", "gru", "thresholds"}


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize(("task", "name"), CASES)
def test_files_give_the_bits_of_the_kernel(task, name, ending, tmp_path):
    assert_bits(epoch(task, name, SHORT), tmp_path, ending)


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize(
    ("name", "k"), [(name, k) for name, sets in OTHERS.items() for k in range(len(sets))]
)
def test_other_settings_do_too(name, k, ending, tmp_path):
    settings = tuple(OTHERS[name][k].items())
    assert_bits(epoch(f"{LIGHT}:dark-1", name, SHORT, settings), tmp_path, ending)


def test_one_robot_alone_computes_what_it_computes_in_its_team(tmp_path):
    from dataclasses import replace

    team, observations, outputs = epoch(f"{LIGHT}:dark-1", "ctrnn", SHORT)
    net = team.network
    weights = {name: values[2:3].copy() for name, values in net.weights.items()}
    alone = replace(team, network=replace(net, weights=weights))
    for ending in (".py", ".h"):
        found = played(step_of(alone, tmp_path, ending), alone, observations[:, 2:3])
        assert found.tobytes() == outputs[:, 2:3].tobytes()


@pytest.mark.parametrize("ending", [".onnx", ".pt2"])
def test_fast_arithmetic_agrees_for_one_step_only(ending, tmp_path):
    """It is chaotic: a difference in the last digit grows with the iterations."""
    team, observations, outputs = epoch("pursuit/team-10", "gru", 300)
    step = step_of(team, tmp_path, ending, fast=True)
    first, _ = step(observations[0], team.first_context)
    assert np.abs(first - outputs[0]).max() < 1e-3
    off = np.abs(played(step, team, observations) - outputs).max(axis=(1, 2))
    assert off.max() > 1


@pytest.mark.parametrize("ending", [one for one in FORMATS if one != ".npz"])
def test_a_sum_of_negative_zeros_is_zero(ending, tmp_path):
    """Sums start with a 0 that is added: 0 + -0 is 0, and onnxruntime leaves out a number 0."""
    from dataclasses import replace

    team, observations, _ = epoch(f"{LIGHT}:dark-1", "srn", SHORT)
    net = team.network
    weights = net.weights | {"w_out": np.full_like(net.weights["w_out"], -0.0)}
    zeros = replace(team, network=replace(net, weights=weights))
    found = played(step_of(zeros, tmp_path, ending), zeros, observations)
    assert found.tobytes() == bytes(found.nbytes)
