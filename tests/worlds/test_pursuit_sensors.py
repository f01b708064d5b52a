"""Sensor averages and ten-segment profiles, in cases with a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.rng import stream
from conevo.worlds.pursuit.study.behaviours import NONE, Conduct
from conevo.worlds.pursuit.study.sensors import (
    N_SEGMENTS,
    Spell,
    average,
    find_spells,
    profile,
    sample,
)


def inputs(n=20, robots=2):
    return np.zeros((n, robots, 22), dtype=np.float32)


def test_average_is_over_each_instance_then_over_the_instances():
    sensed = inputs()
    sensed[0:2, 0, 3] = 0.8  # a short instance and a long one weigh the same
    sensed[10:18, 0, 3] = 0.2
    sensed[:, 0, 16:] = 9.0  # context inputs are not sensors
    sensed[:, 1] = 9.0  # another predator's inputs do not count either
    some = [Spell(0, 0, "pursuer", 0, 2), Spell(0, 0, "pursuer", 10, 18)]
    expected = np.zeros(16)
    expected[3] = 0.5
    assert average(some, [sensed]) == pytest.approx(expected)


def test_instances_of_several_epochs():
    first, second = inputs(), inputs()
    first[:, 0, 8] = 1.0
    some = [Spell(0, 0, "idle", 0, 5), Spell(1, 0, "idle", 0, 5)]
    assert average(some, [first, second])[8] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("value", "segment"),
    [(1e-6, 0), (0.1, 0), (0.101, 1), (0.2, 1), (0.55, 5), (0.9, 8), (0.901, 9), (1.0, 9)],
)
def test_a_segment_includes_its_upper_end(value, segment):
    sensed = inputs().astype(np.float64)
    sensed[:, 0, 8:16] = value
    seen = profile([Spell(0, 0, "pursuer", 0, 20)], [sensed])
    assert seen.light.tolist() == [float(k == segment) for k in range(N_SEGMENTS)]
    assert seen.proximity.tolist() == [0.0] * N_SEGMENTS  # at 0 a sensor is not active


def test_portions_are_those_of_the_duration_and_of_the_sensors():
    sensed = inputs()
    sensed[0:5, 0, 0] = 0.95  # one of eight sensors, a quarter of the duration
    sensed[5:15, 0, 1] = 0.35
    seen = profile([Spell(0, 0, "pursuer", 0, 20)], [sensed])
    expected = np.zeros(N_SEGMENTS)
    expected[9], expected[3] = 0.25 / 8, 0.5 / 8
    assert seen.proximity == pytest.approx(expected)
    assert seen.proximity.sum() == pytest.approx((sensed[:, 0, :8] > 0).mean())


def test_a_sensor_that_sweeps_the_range_is_in_all_segments_equally():
    sensed = inputs(1000)
    sensed[:, 0, 8:16] = ((np.arange(1000) + 0.5) / 1000)[:, None]
    seen = profile([Spell(0, 0, "pursuer", 0, 1000)], [sensed])
    assert seen.light == pytest.approx(np.full(N_SEGMENTS, 0.1))


def test_instances_are_stretches_of_one_behaviour_within_interactions():
    behaviour = np.array([NONE, 0, 0, 1, 0, 0, 0, 4, 4])[:, None]
    interacts = np.array([1, 1, 1, 1, 1, 0, 1, 0, 0], dtype=bool)[:, None]
    one = Conduct(behaviour, interacts, np.zeros_like(behaviour), 1)
    assert find_spells([one, one]) == [
        Spell(epoch, 0, name, start, stop)
        for epoch in (0, 1)
        for name, start, stop in (
            ("pursuer", 1, 3), ("pursuer", 4, 5), ("pursuer", 6, 7), ("blocker", 3, 4),
        )
    ]  # fmt: skip


def test_sampling_draws_without_replacement_and_reproducibly():
    found = [Spell(0, 0, "pursuer", k, k + 1) for k in range(50)]
    some = sample(found, 20, stream(3, "instances"))
    assert len(set(some)) == 20
    assert some == sample(found, 20, stream(3, "instances"))
    assert some != sample(found, 20, stream(4, "instances"))
    assert sample(found[:7], 20, stream(3, "instances")) == found[:7]
    drawn = [one.start for k in range(400) for one in sample(found, 20, stream(k, "s"))]
    shares = np.bincount(drawn, minlength=50) / 400
    assert shares == pytest.approx(np.full(50, 0.4), abs=0.12)
