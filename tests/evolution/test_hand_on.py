"""Populations taken into the next task: genes and sizes are kept, everything else starts again."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import METHODS, Layout, Progress, Scores, State, method
from conevo.evolution.inheritance import breed_from, hand_on

LAYOUT = Layout(n_robots=2, n_hidden=3, max_hidden=5, n_genes=4)
CONE = method("cone").config
TAKEN = {"genes", "active", "progress.n_hidden"}
GENERAL = [name for name, entry in METHODS.items() if not entry.controllers]  # for any sizes
AROUND_A_TEAM = [name for name in GENERAL if hasattr(method(name), "begin_with")]
with_populations = pytest.mark.parametrize("name", [m for m in GENERAL if m not in AROUND_A_TEAM])
OF_ONE_TEAM = [name for name in AROUND_A_TEAM if name != "map-elites"]  # it has no centre
around_a_team = pytest.mark.parametrize("name", OF_ONE_TEAM)


def build(name: str):
    """Return a method with short windows, so that thresholds and sizes change soon."""
    known = {one.name for one in fields(METHODS[name].config_class)}
    windows = {"stagnation_v", "stagnation_w", "stagnation_y"} & known
    sizes = {"genotypes": 6, "elite_portion": 0.5, "pairs": 10}
    sizes = {key: size for key, size in sizes.items() if key in known}
    return method(name, **sizes, **dict.fromkeys(sorted(windows), 1))


def evolve(learner, state: State, generations: int) -> State:
    """Return the state after a number of generations of falling scores."""
    end = state.progress.generation + generations
    while state.progress.generation < end:
        trials = learner.ask(state)
        networks = trials.networks().astype(np.float64)
        fitness = np.sin(5 * networks).sum(axis=(2, 3)) - 5 * trials.generation
        scores = Scores(fitness, np.abs(networks[:, :, 0, 0]), np.abs(networks[:, :, :2, 1]) / 2)
        state = learner.tell(state, trials, scores)
    return state


def contents(record: object, prefix: str = "") -> dict[str, object]:
    """Return the fields of a state, by name, those of its header as "progress.root"."""
    found: dict[str, object] = {}
    for one in fields(record):
        value, name = getattr(record, one.name), prefix + one.name
        found |= contents(value, f"{name}.") if is_dataclass(value) else {name: value}
    return found


def same(a: State, b: State, names: set[str]) -> None:
    """Check that two states agree in some fields bit for bit, and in their types."""
    left, right = contents(a), contents(b)
    for name in names:
        assert np.asarray(left[name]).dtype == np.asarray(right[name]).dtype, name
        np.testing.assert_equal(left[name], right[name], err_msg=name)


@with_populations
def test_genes_and_slots_are_taken_over_and_all_else_starts_again(name: str) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 8)
    if "stagnation_y" in METHODS[name].config_class.__dataclass_fields__:
        while (old.progress.n_hidden == LAYOUT.n_hidden).all():  # until a size is about to change
            old = evolve(learner, old, 1)
    new, fresh = hand_on(learner, LAYOUT, 7, old), learner.init(LAYOUT, 7)
    same(new, old, TAKEN)
    same(new, fresh, contents(fresh).keys() - TAKEN)


@pytest.mark.parametrize(
    ("old", "new", "taken"),
    [("cone", "cone", {"sst", "gst"}), ("cone", "cone-1", {"sst"}), ("cone-2", "cone-2", {"gst"})],
)
def test_thresholds_may_be_taken_over(old: str, new: str, taken: set[str]) -> None:
    before: Any = evolve(build(old), build(old).init(LAYOUT, 3), 2)
    before = replace(before, **dict.fromkeys(sorted(taken), 0.375))
    learner = method(new, genotypes=6, elite_portion=0.5, thresholds_from="ancestor")
    after, fresh = hand_on(learner, LAYOUT, 7, before), learner.init(LAYOUT, 7)
    same(after, before, TAKEN | taken)
    same(after, fresh, contents(fresh).keys() - TAKEN - taken)
    for name in taken:
        assert (getattr(after, name), getattr(fresh, name)) == (0.375, getattr(CONE, name))


def test_thresholds_that_an_ancestor_does_not_have_are_refused() -> None:
    learner = method("cone", genotypes=6, thresholds_from="ancestor")
    for name, missing in (("mesp", "sst"), ("cone-1", "gst"), ("cone-2", "sst")):
        with pytest.raises(UsageError, match=f"the origin of this run has no {missing}"):
            hand_on(learner, LAYOUT, 3, build(name).init(LAYOUT, 3))
    genes, active = np.zeros((2, 5, 4), dtype=np.float32), np.ones((2, 5), dtype=bool)
    with pytest.raises(UsageError, match="the origin of this run has no sst"):
        breed_from(learner, LAYOUT, 3, genes, active)


@with_populations
@pytest.mark.parametrize("n_robots", [1, 2, 5])
def test_a_team_of_another_size_is_filled_in_turn(name: str, n_robots: int) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 8)
    new = hand_on(learner, replace(LAYOUT, n_robots=n_robots), 3, old)
    n_populations = 1 if len(old.genes) == 1 else n_robots
    assert len(new.genes) == n_populations
    for p in range(n_populations):
        np.testing.assert_array_equal(new.genes[p], old.genes[p % len(old.genes)])
        np.testing.assert_array_equal(new.active[p], old.active[p % len(old.genes)])
    assert new.progress.fittest_fitness.shape == (n_robots,)
    trials = learner.ask(new)
    assert trials.teams.shape[1] == n_robots
    rows = {row.tobytes() for row in old.genes.reshape(-1, LAYOUT.n_genes)}
    played = trials.networks()[trials.teams >= 0]
    assert {row.tobytes() for row in played} <= rows
    later = evolve(learner, new, 4)
    assert later.progress.generation == 4
    assert np.abs(later.genes).max() <= 1
    assert not later.genes[~later.active].any()


@with_populations
def test_nothing_of_the_old_state_is_changed_or_shared(name: str) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 2)
    before = old.genes.copy()
    new = hand_on(learner, LAYOUT, 3, old)
    assert not np.shares_memory(new.genes, old.genes)
    assert not np.shares_memory(new.active, old.active)
    evolve(learner, new, 2)
    np.testing.assert_array_equal(old.genes, before)


@with_populations
def test_populations_that_do_not_fit_are_refused(name: str) -> None:
    learner = build(name)
    old = learner.init(LAYOUT, 3)
    for layout, words in (
        (replace(LAYOUT, max_hidden=6), "5 slots became 6"),
        (replace(LAYOUT, n_genes=9), "4 genes per neuron became 9"),
    ):
        with pytest.raises(UsageError, match=words):
            hand_on(learner, layout, 3, old)
    with pytest.raises(UsageError, match="6 genotypes per slot became 8"):
        hand_on(method(name, genotypes=8), LAYOUT, 3, old)


def test_neurons_are_not_networks() -> None:
    mesp, ccga = build("mesp"), build("ccga")
    with pytest.raises(UsageError, match="neurons do not mix with whole networks"):
        hand_on(ccga, LAYOUT, 3, mesp.init(LAYOUT, 3))


@with_populations
def test_populations_bred_from_a_team_contain_it_and_vary_around_it(name: str) -> None:
    learner = build(name)
    fresh = learner.init(LAYOUT, 3)
    active = np.zeros((2, 5), dtype=bool)
    active[:, :3] = True
    genes = np.linspace(-0.9, 0.9, 2 * 5 * 4, dtype=np.float32).reshape(2, 5, 4)
    genes = np.where(active[..., None], genes, np.float32(0))
    state = breed_from(learner, LAYOUT, 3, genes, active)
    same(state, fresh, contents(fresh).keys() - TAKEN)
    one_population = len(state.genes) == 1
    for p, m in ((0, 0), (0, 1)) if one_population else ((0, 0), (1, 0)):
        np.testing.assert_array_equal(state.genes[p, :, m], genes[m if one_population else p])
    for p in range(len(state.genes)):
        for m in range(1 if not one_population else 2, 6):
            source = genes[m % 2 if one_population else p]
            changed = state.genes[p, :, m] != source
            assert not changed[3:].any()
            assert changed.mean() < 0.5
    assert (state.genes != breed_from(learner, LAYOUT, 4, genes, active).genes).any()
    assert np.unique(state.genes[0].swapaxes(0, 1).reshape(6, -1), axis=0).shape[0] > 2
    same(breed_from(learner, LAYOUT, 3, genes, active), state, TAKEN)
    assert learner.ask(state).teams.shape == learner.ask(fresh).teams.shape


@with_populations
def test_start_noise_is_normal_noise_on_every_gene_but_those_of_the_team_itself(name: str) -> None:
    learner = replace(
        build(name), config=replace(build(name).config, genotypes=2000, start_noise=0.02)
    )
    active = np.zeros((2, 5), dtype=bool)
    active[:, :3] = True
    genes = np.where(active[..., None], np.float32(0.5), np.float32(0)) * np.ones(4, np.float32)
    genes[1, 2, 3] = 1.0
    state = breed_from(learner, LAYOUT, 3, genes, active)
    n_kept = 2 if len(state.genes) == 1 else 1
    for p in range(len(state.genes)):
        for m in range(n_kept):
            np.testing.assert_array_equal(state.genes[p, :, m], genes[max(p, m)])
        spread = state.genes[p, :2, n_kept:] - 0.5
        assert (spread != 0).mean() > 0.999
        assert abs(spread.mean()) < 5 * 0.02 / spread.size**0.5
        assert abs(spread.std() / 0.02 - 1) < 5 / (2 * spread.size) ** 0.5
        assert not state.genes[p, 3:].any()
    limited = state.genes[-1, 2, n_kept:, 3]
    assert limited.max() == 1.0
    every_other = limited[1::2] if n_kept == 2 else limited
    assert abs((every_other == 1.0).mean() - 0.5) < 0.08  # half of the noise is cut off
    assert state.genes.dtype == np.float32


def test_a_team_of_other_sizes_is_refused() -> None:
    genes, active = np.zeros((2, 5, 3), dtype=np.float32), np.ones((2, 5), dtype=bool)
    with pytest.raises(UsageError, match="3 genes per neuron became 4"):
        breed_from(build("mesp"), LAYOUT, 3, genes, active)
    genes = np.zeros((2, 5, 4), dtype=np.float32)
    assert breed_from(build("mesp"), LAYOUT, 3, genes, active).progress.n_hidden.tolist() == [5, 5]
    with pytest.raises(UsageError, match="has networks of 3 neurons, which never grow"):
        breed_from(build("ccga"), LAYOUT, 3, genes, active)


# --- methods that start around a team -------------------------------------------------------------

AROUND = {"mean", "deviations", "genes", "active", "phase", "progress.n_hidden"}
ONE_BIT = 2.0**-23  # of a gene of 1


def team_of(n_robots: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a team [R, 5, 4] whose robots differ, and its slots in use: three of five."""
    active = np.zeros((n_robots, 5), dtype=bool)
    active[:, [0, 1, 3]] = True
    genes = np.random.default_rng(4).uniform(-1, 1, (n_robots, 5, 4)).astype(np.float32)
    return np.where(active[..., None], genes, np.float32(0)), active


def centre(learner: Any, state: Any) -> np.ndarray:
    """Return the team [R, U, G] around which a state's teams are, as it would play at the end."""
    played: np.ndarray = learner.ask(replace(state, phase="fittest")).networks()[0]
    return played


@around_a_team
@pytest.mark.parametrize("ancestor", ["own", "cone", "homcne"])
def test_a_method_without_populations_starts_around_the_fittest_team(
    name: str, ancestor: str
) -> None:
    learner = build(name)
    before = learner if ancestor == "own" else build(ancestor)
    old = evolve(before, before.init(LAYOUT, 3), 8)
    new, fresh = hand_on(learner, LAYOUT, 7, old), learner.init(LAYOUT, 7)
    kept = {name for name in contents(fresh) if not name.startswith("distribution.")}
    same(new, fresh, kept - AROUND)
    ended = old.progress
    bred = breed_from(learner, LAYOUT, 7, ended.fittest_genes, ended.fittest_active)
    same(new, bred, set(contents(new)))
    assert evolve(learner, new, 3).progress.generation == 3


@around_a_team
@pytest.mark.parametrize("n_robots", [1, 2, 5])
def test_it_starts_with_each_robot_of_the_team_in_turn(name: str, n_robots: int) -> None:
    learner: Any = build(name)
    genes, active = team_of(3)
    layout = replace(LAYOUT, n_robots=n_robots)
    state: Any = breed_from(learner, layout, 3, genes, active)
    expected = genes[np.arange(n_robots) % 3]
    if name != "cone-es":  # clones
        expected = np.broadcast_to(expected.mean(axis=0, dtype=np.float64), expected.shape)
    np.testing.assert_allclose(centre(learner, state), expected, rtol=0, atol=ONE_BIT)
    if hasattr(state, "deviations"):
        assert np.abs(state.deviations.mean(axis=0, dtype=np.float64)).max() <= ONE_BIT
    assert np.atleast_2d(state.active).tolist() == active[:1].tolist()
    assert state.progress.n_hidden.tolist() == [3]
    assert state.problem(learner.init(layout, 3)) == ""
    played = learner.ask(state).networks()
    if name != "cma-es":  # mirrored pairs
        np.testing.assert_allclose(played.mean(axis=0), expected, rtol=0, atol=0.1)
    assert not played[:, :, [2, 4]].any()
    assert evolve(learner, state, 2).progress.generation == 2


@around_a_team
@pytest.mark.parametrize("n_robots", [1, 3, 7, 20])
def test_for_a_team_of_clones_it_is_the_clone_bit_for_bit(name: str, n_robots: int) -> None:
    learner: Any = build(name)
    genes, active = team_of(1)
    clones = genes.repeat(n_robots, axis=0), active.repeat(n_robots, axis=0)
    state: Any = breed_from(learner, replace(LAYOUT, n_robots=n_robots), 3, *clones)
    np.testing.assert_array_equal(centre(learner, state), clones[0])


@around_a_team
def test_a_slot_that_some_robot_uses_starts_with_zeros_in_the_others(name: str) -> None:
    genes, active = team_of(2)
    genes[1, 3], active[1, 3] = 0, False
    learner = build(name)
    state: Any = breed_from(learner, LAYOUT, 3, genes, active)
    assert np.atleast_2d(state.active).tolist() == [[True, True, False, True, False]]
    mean = centre(learner, state).mean(axis=0)
    np.testing.assert_allclose(mean[3], genes[0, 3] / 2, rtol=0, atol=ONE_BIT)


@around_a_team
def test_teams_that_do_not_fit_are_refused(name: str) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 1)
    for layout, words in (
        (replace(LAYOUT, max_hidden=6), "ES cannot start from this team: 5 slots became 6"),
        (replace(LAYOUT, n_genes=9), "ES cannot start from this team: 4 genes per neuron became 9"),
    ):
        with pytest.raises(UsageError, match=words):
            hand_on(learner, layout, 3, old)
        with pytest.raises(UsageError, match=words):
            breed_from(learner, layout, 3, *team_of(2))
    for learner_of in (learner, build("cone")):  # before its first team, sizes need not fit
        anew = hand_on(learner, LAYOUT, 3, learner_of.init(LAYOUT, 3))
        same(anew, learner.init(LAYOUT, 3), set(contents(anew)))
    with pytest.raises(UsageError, match="the method it is from has none"):
        hand_on(build("cone"), LAYOUT, 3, old)


@around_a_team
def test_nothing_of_a_team_is_changed_or_shared(name: str) -> None:
    learner = build(name)
    genes, active = team_of(1)
    given = genes.copy(), active.copy()
    state: Any = breed_from(learner, replace(LAYOUT, n_robots=1), 3, genes, active)
    for one in contents(state).values():
        if isinstance(one, np.ndarray):
            assert not np.shares_memory(one, genes)
            assert not np.shares_memory(one, active)
    evolve(learner, state, 2)
    np.testing.assert_array_equal(genes, given[0])
    np.testing.assert_array_equal(active, given[1])


@dataclass(frozen=True)
class Alone:
    """A state without populations."""

    progress: Progress


@dataclass(frozen=True)
class Hermit:
    """A method whose state has no populations."""

    config: object = field(default_factory=object)
    name: str = "hermit"
    title: str = "Hermit"

    def init(self, layout: Layout, root: int) -> Alone:
        """Return generation 0."""
        return Alone(Progress.first(layout, root))


def test_a_method_without_populations_takes_over_none() -> None:
    hermit, mesp = Hermit(), build("mesp")
    for learner, old, words in (
        (hermit, mesp.init(LAYOUT, 3), "Hermit has none that consists of controllers"),
        (mesp, hermit.init(LAYOUT, 3), "the method it is from has none"),
    ):
        with pytest.raises(UsageError, match=words) as caught:
            hand_on(learner, LAYOUT, 3, old)
        assert "\n" not in str(caught.value)
    genes, active = np.zeros((2, 5, 4), dtype=np.float32), np.ones((2, 5), dtype=bool)
    with pytest.raises(UsageError, match="no population can be bred from this team: Hermit has"):
        breed_from(hermit, LAYOUT, 3, genes, active)
