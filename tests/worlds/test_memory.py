"""If a device has too little memory, fewer teams are played at once, with the same results."""

import weakref
from math import prod
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from conevo.errors import EnvironmentFailure
from conevo.kernels import arrays
from conevo.worlds import rollout as rolling
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from contracts.test_worlds import assert_same_bits, keys, random_teams

TASK = world("rover/complex-1", n_robots=3, iterations=8)
GENES, TEAMS = random_teams(TASK, 13)
SCENARIOS = TASK.scenarios(keys(2))
SHRUNK = "device cpu lacks memory for {} at once: it plays {}, with the same results"


@pytest.fixture
def room(monkeypatch):
    """Return a list of the worlds (or teams) with room; a new state replaces all others."""
    limit, alive = [0], []

    def allocate(struct, shape_of, n, device):
        if "fitness" in shape_of:
            assert [one for one in alive if one() is not None] == []
        if n > limit[0]:
            raise RuntimeError(f"Failed to allocate {4 * n} bytes on device '{device}'")
        made = arrays.allocate(struct, shape_of, n, device)
        alive.extend(weakref.ref(getattr(made, name)) for name in shape_of)
        return made

    monkeypatch.setattr(rolling, "allocate", allocate)
    return limit


@pytest.mark.parametrize(
    ("worlds", "messages"),
    [(26, []), (25, [("26 worlds", 12)]), (7, [("26 worlds", 6)]), (2, [("26 worlds", 2)])],
)
def test_the_number_of_teams_at_once_depends_on_memory(worlds, messages, room, caplog):
    room[0] = worlds
    rollout = Rollout(TASK, n_threads=1)
    for _ in range(2):
        shrunk = rollout.evaluate(GENES, TEAMS, SCENARIOS)
    assert caplog.messages == [SHRUNK.format(*one) for one in messages]
    del rollout
    room[0] = 1000
    assert_same_bits(Rollout(TASK, n_threads=1).evaluate(GENES, TEAMS, SCENARIOS), shrunk)


def test_one_team_without_room_is_a_failure_of_the_machine(room, caplog):
    room[0] = 1
    rollout = Rollout(TASK, n_threads=1)
    with pytest.raises(EnvironmentFailure, match=r"^device 'cpu': too little free memory; end"):
        rollout.evaluate(GENES, TEAMS, SCENARIOS)
    assert caplog.messages == []
    room[0] = 2
    assert rollout.evaluate(GENES, TEAMS[:1], SCENARIOS).fitness.shape == (1, 2, 3)


def test_room_for_many_teams_is_given_up_for_one_in_many_scenarios(room, caplog):
    """A workspace grows to the worlds and the teams of any two batches, if there is memory."""
    room[0] = 13
    rollout = Rollout(TASK, n_threads=1)
    one = TASK.scenarios(keys(1))
    rollout.evaluate(GENES, TEAMS, one)
    room[0] = 12
    many = TASK.scenarios([*keys(2)] * 6)
    assert rollout.evaluate(GENES, TEAMS[:1], many).fitness.shape == (1, 12, 3)
    room[0] = 14
    many = TASK.scenarios([*keys(2)] * 7)
    assert rollout.evaluate(GENES, TEAMS[:1], many).fitness.shape == (1, 14, 3)
    assert caplog.messages == []


def test_other_errors_are_not_mistaken_for_it(room, monkeypatch):
    def broken(*_):
        raise RuntimeError("CUDA error 700: an illegal memory access was encountered")

    monkeypatch.setattr(rolling, "allocate", broken)
    with pytest.raises(RuntimeError, match="CUDA error 700"):
        Rollout(TASK, n_threads=1).evaluate(GENES, TEAMS, SCENARIOS)


def test_arrays_without_room_are_a_failure_of_the_machine(monkeypatch):
    def refused(values, **_):
        raise RuntimeError(f"Failed to allocate {values.nbytes} bytes on device 'cpu'")

    rollout = Rollout(TASK, n_threads=1)
    monkeypatch.setattr(rolling.wp, "array", refused)
    with pytest.raises(EnvironmentFailure, match="device 'cpu': too little free memory"):
        rollout.evaluate(GENES, TEAMS, SCENARIOS)


class OnDevice:
    """An array on a device; counts the numbers fetched from it."""

    device = SimpleNamespace(is_cpu=False)

    def __init__(self, values):
        self.values, self.shape, self.fetched = values, values.shape, []

    def __getitem__(self, some):
        cut = OnDevice(self.values[some])
        cut.fetched = self.fetched
        return cut

    def numpy(self):
        self.fetched.append(self.values.size)
        return self.values.copy()


@pytest.mark.parametrize(
    ("apart", "shape"), [((), (3,)), ((), ()), ((), (3, 4)), ((5,), (3, 5)), ((5,), (3, 2, 5))]
)
def test_no_more_is_fetched_from_a_device_than_is_read(apart, shape):
    """An array has ``shape`` for each of 7 worlds; its own last dimension stays separate."""
    whole = np.arange(7 * prod(shape)).reshape(7, *shape)
    flat = whole.reshape(-1, *apart)
    there = OnDevice(flat)
    here = wp.array(flat, dtype=wp.int64, device="cpu")
    for n in (1, 3, 7):
        assert np.array_equal(arrays.first_parts(there, n, shape), whole[:n])
        assert there.fetched.pop() == n * prod(shape)
        assert np.array_equal(arrays.first_parts(here, n, shape), whole[:n])
    kept = arrays.first_parts(here, 1, shape)
    here.fill_(-1)
    assert np.array_equal(kept, whole[:1])  # the next launch does not change the fetched array
