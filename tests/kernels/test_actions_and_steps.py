"""The actions and steps that all worlds share, against plain Python."""

import itertools
import math

import numpy as np
import pytest
import warp as wp

from conevo.kernels import engine
from conevo.kernels.actions import NONE, begin_counting, count_action, heuristic_action
from conevo.kernels.outputs import highest
from conevo.kernels.steps import is_taken, random_step, steered_step

engine.start()
wp.set_module_options(engine.options)  # without adjoints, as in the worlds


@wp.kernel
def live(
    lives: wp.array2d[int],
    action: wp.array[int],
    switches: wp.array[int],
    counts: wp.array[int],
):
    for i in range(lives.shape[0]):
        begin_counting(action, switches, counts, i)
    for t in range(lives.shape[1]):
        for i in range(lives.shape[0]):
            a = lives[i, t]
            count_action(action, switches, counts, i, a, 2 * wp.max(a, 0) + t % 2)


@wp.kernel
def choose(u: wp.array[float], own: int, a: wp.array[int]):
    k = wp.tid()
    a[k] = heuristic_action(u[k], own, 3, 4)


@wp.kernel
def look(outputs: wp.array2d[float], n: int, best: wp.array[int]):
    i = wp.tid()
    best[i] = highest(outputs, i, n)


@wp.kernel
def step(u: wp.array[float], v: wp.array[float], at: wp.array[wp.vec2f], to: wp.array[wp.vec2f]):
    k = wp.tid()
    at[k] = random_step(u[k], 0.01)
    to[k] = steered_step(u[k], v[k], 0.01)


@wp.kernel
def ask(xs: wp.array[float], ys: wp.array[float], n: int, i: int, taken: wp.array[int]):
    k = wp.tid()
    taken[k] = int(is_taken(xs, ys, n, i, xs[k], ys[k], 0.0625))


def zeros(n, dtype=int):
    return wp.zeros(n, dtype=dtype, device="cpu")


def array(values, dtype):
    return wp.array(np.asarray(values), dtype=dtype, device="cpu")


def test_every_action_counts_once_and_switches_are_changes_between_iterations():
    lives = np.random.default_rng(3).integers(-1, 3, (5, 60)).astype(np.int32)
    action, switches, counts = zeros(5), zeros(5), array(np.full(5 * 6, 7), int)
    wp.launch(live, 1, [array(lives, int), action, switches, counts], device="cpu")
    assert action.numpy().tolist() == lives[:, -1].tolist()
    for i, life in enumerate(lives.tolist()):
        expected = [0] * 6
        for t, a in enumerate(life):
            if a >= 0:
                expected[2 * a + t % 2] += 1
        assert counts.numpy()[6 * i : 6 * i + 6].tolist() == expected
        pairs = itertools.pairwise(life)
        assert switches.numpy()[i] == sum(a != b and a >= 0 and b >= 0 for a, b in pairs)


@pytest.mark.parametrize("own", [0, 1, 2, int(NONE)])
def test_a_heuristic_prefers_its_own_action_in_seven_of_ten(own):
    u = ((np.arange(1000) + 0.5) / 1000).astype(np.float32)
    a = zeros(1000)
    wp.launch(choose, 1000, [array(u, float), own, a], device="cpu")
    expected = {0: 250, 1: 250, 2: 250, 3: 250} if own == NONE else {own: 700, 3: 300}
    assert {k: n for k, n in enumerate(np.bincount(a.numpy())) if n} == expected


def test_the_last_action_is_the_last_even_where_rounding_would_go_beyond_it():
    a = zeros(1)
    wp.launch(choose, 1, [array([1.0], float), int(NONE), a], device="cpu")
    assert a.numpy().tolist() == [3]


def test_ties_for_the_highest_output_go_to_the_first_among_those_asked_for():
    outputs = np.random.default_rng(4).integers(-2, 3, (40, 8)).astype(np.float32)
    for n in (1, 3, 8):
        best = zeros(40)
        wp.launch(look, 40, [array(outputs, float), n, best], device="cpu")
        assert best.numpy().tolist() == outputs[:, :n].argmax(axis=1).tolist()


def test_a_random_step_has_its_length_and_a_steered_one_at_most_that():
    u = ((np.arange(64) + 0.5) / 64).astype(np.float32)
    v = np.linspace(-40, 40, 64, dtype=np.float32)
    at, to = zeros(64, wp.vec2f), zeros(64, wp.vec2f)
    wp.launch(step, 64, [array(u, float), array(v, float), at, to], device="cpu")
    turn = 2 * math.pi * u
    np.testing.assert_allclose(
        at.numpy(), 0.01 * np.stack([np.cos(turn), np.sin(turn)], axis=1), atol=1e-8
    )
    most = 0.01 * math.sqrt(2)
    logistic = 1 / (1 + np.exp(-np.stack([u, v], axis=1).astype(np.float64)))
    np.testing.assert_allclose(to.numpy(), most * (logistic - 0.5), atol=1e-7)
    wp.launch(step, 64, [array(v, float), array(v, float), at, to], device="cpu")
    lengths = np.hypot(*to.numpy().T)
    assert lengths.max() <= 0.01 * (1 + 1e-6)
    assert lengths[[0, -1]] == pytest.approx(0.01, rel=1e-4)


def test_a_place_is_taken_by_another_robot_that_is_closer_than_the_separation():
    xs, ys = [0.0, 0.25, 1.0, 1.125, 5.0], [0.0, 0.0, 1.0, 1.0, 5.0]  # exact in binary

    def taken(n, i):
        found = zeros(5)
        wp.launch(ask, 5, [array(xs, float), array(ys, float), n, i, found], device="cpu")
        return found.numpy().tolist()

    assert taken(5, -1) == [1, 1, 1, 1, 1]  # a robot's own place, unless it is left out
    assert taken(5, 0) == [0, 1, 1, 1, 1]  # 0 and 1 are exactly the separation apart
    assert taken(5, 2) == [1, 1, 1, 1, 1]
    assert taken(2, 4) == [1, 1, 0, 0, 0]
    assert taken(0, 4) == [0, 0, 0, 0, 0]
