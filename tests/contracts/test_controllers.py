"""The contract of controllers, for every entry of the registry, in several worlds."""

from math import prod
from pathlib import Path

import numpy as np
import pytest

from conevo.controllers.registry import CONTROLLERS, controller
from conevo.errors import UsageError
from conevo.kernels.arrays import dimensions
from conevo.rng import stream
from conevo.runs.config import resolve
from conevo.worlds.protocol import Scenarios
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from contracts.test_worlds import assert_same_bits, keys

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
WORLDS = ("rover/complex-5", "pursuit/team-3", "gacc/complex-9", f"{LIGHT}:dark-1")
ITERATIONS = 30
# Further settings of each controller to try, in addition to those that the world suggests.
SETTINGS = {
    "srn": (
        {"n_hidden": 3, "max_hidden": 3, "recurrent": False},
        {"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5, "bias": True},  # two chunks
    ),
    "gru": ({"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5},),
    "ctrnn": ({"n_hidden": 16, "max_hidden": 32, "weight_scale": 1.5, "slowest": 1.0},),
    "graph": ({"max_hidden": 0}, {"max_hidden": 31, "weight_scale": 3.0}),
    "thresholds": ({"stimulus": "input", "theta": 0.3, "xi": 0.125, "phi": 0.01, "steepness": 3},),
    "rules": (
        {
            "conditions": "intervals",
            "conflict": "priority",
            "dont_care": 0.3,
            "n_rules": 3,
            "max_rules": 40,
        },
    ),
}
# Controllers whose functions are compiled for two worlds only in CI, since no world changes them:
# the example, and the one for which the tests of exported files compile most of them, too. In the
# form with lanes they are compiled for the example only.
IN_TWO = ("ctrnn", "gru", "graph", "thresholds", "rules")
TWO = (f"{LIGHT}:dark-1", "pursuit/team-3")


def cases(worlds):
    """Return all pairs of a world and a controller; in CI those of ``IN_TWO`` in these worlds."""
    return [
        pytest.param(
            (path, name, settings),
            id=f"{Path(path).name}-{name}-{k}",
            marks=[pytest.mark.exhaustive] if name in IN_TWO and path not in worlds else [],
        )
        for path in WORLDS
        for name in CONTROLLERS
        for k, settings in enumerate(({}, *SETTINGS.get(name, ())))
    ]


def made(request):
    """Return a world and a controller of its robots."""
    path, name, settings = request.param
    a_world = world(path, iterations=ITERATIONS)
    return a_world, controller(name, world=a_world, **settings)


@pytest.fixture(params=cases(TWO), scope="module")
def case(request):
    return made(request)


@pytest.fixture(params=cases(TWO[:1]))
def case_in_lanes(request):
    return made(request)


@pytest.fixture
def rollout(case):
    return Rollout(*case, n_threads=1)


def teams_of(rollout, n, seed=3):
    """Return a pool and teams with holes; the first robot of each is empty, the last one full."""
    rng, genome, r = stream(seed, "teams"), rollout.genome, rollout.world.n_robots
    pool = rng.uniform(-1, 1, (50, genome.n_genes)).astype(np.float32)
    pool[:5] *= 0.01  # small, so that no unit saturates
    teams = rng.integers(len(pool), size=(n, r, genome.max_parts)).astype(np.int32)
    holes = rng.random(teams.shape) < rng.random((n, r, 1))
    holes[:, 0], holes[:, -1] = True, False
    teams[holes] = -1
    return pool, teams


def batched(rollout, n_worlds):
    """Return a rollout that plays few worlds at once, so that it needs several launches."""
    rollout._chunk = n_worlds
    return rollout


def test_forward_equals_the_kernel_bit_for_bit_in_every_iteration(rollout):
    mind, a_world, genome = rollout.controller, rollout.world, rollout.genome
    pool, teams = teams_of(rollout, 2)
    for team in teams:
        seen = rollout.record(pool, team, a_world.scenarios(keys(1)))
        active = team >= 0
        genes = pool[team]  # an empty slot may have any genes: they must have no effect
        memory = np.zeros((*team.shape, mind.n_memory), np.float32)
        for t in range(ITERATIONS):
            outputs, memory = mind.forward(
                genes, active, memory, seen["inputs"][t], len(a_world.outputs)
            )
            assert memory.shape == (a_world.n_robots, genome.max_parts, mind.n_memory)
            assert (outputs.dtype, memory.dtype) == (np.float32, np.float32)
            assert outputs.tobytes() == seen["outputs"][t].tobytes(), t
            hidden = np.ascontiguousarray(memory[:, :, 0])
            assert hidden.tobytes() == seen["hidden"][t].tobytes(), t
        assert np.ptp(seen["outputs"], axis=(0, 1)).all()  # robots differ


def test_empty_slots_stay_zero_and_full_ones_do_not(rollout):
    pool, teams = teams_of(rollout, 2)
    for team in teams:
        hidden = rollout.record(pool, team, rollout.world.scenarios(keys(1)))["hidden"]
        assert hidden.shape == (ITERATIONS, *team.shape)
        assert not hidden[:, team < 0].any()
        assert (hidden[:, team >= 0] != 0).any(axis=0).all()


def test_robots_of_a_heuristic_controller_neither_think_nor_remember(rollout):
    pool, (team,) = teams_of(rollout, 1)
    heuristic = np.zeros(len(team), np.int32)
    heuristic[-1] = -1
    seen = rollout.record(pool, team, rollout.world.scenarios(keys(1)), heuristic)
    for name in ("outputs", "hidden"):
        assert not seen[name][:, :-1].any(), name
        assert seen[name][:, -1].any(), name


def test_scenarios_share_a_teams_weights_but_not_memory(case, rollout):
    n, e, r = 3, 2, rollout.world.n_robots
    pool, teams = teams_of(rollout, n)
    scenarios = rollout.world.scenarios(keys(e))
    rollout.evaluate(pool, teams, scenarios)
    at, mind = rollout._workspace, rollout._mind
    for struct, parts in ((at.weights, n), (at.memory, n * e)):
        for name, those in dimensions(struct._cls, lambda _: ("robots",)).items():
            size = prod((mind.sizes | {"robots": r, "team": 1})[one] for one in those)
            assert those[0] in ("robots", "team")
            assert getattr(struct, name).size == parts * size, name
    left = getattr(at.memory, mind.probe).numpy().reshape(n, e, r, -1)
    alone = Rollout(*case, n_threads=1)
    for k in range(n):
        for j, key in enumerate(keys(e)):
            seen = alone.record(pool, teams[k], rollout.world.scenarios([key]))
            hidden = np.ascontiguousarray(left[k, j, :, : rollout.genome.max_parts])
            assert hidden.tobytes() == seen["hidden"][-1].tobytes(), (k, j)
    both = rollout.evaluate(pool, teams, scenarios)
    for j, key in enumerate(keys(e)):
        one = alone.evaluate(pool, teams, rollout.world.scenarios([key]))
        assert both.fitness[:, j].tobytes() == one.fitness[:, 0].tobytes()
        assert both.counts[:, j].tobytes() == one.counts[:, 0].tobytes()


def batch_of(rollout):
    """Return a pool, teams, one of them with heuristic robots, and scenarios."""
    pool, teams = teams_of(rollout, 7)
    heuristic = np.full(teams.shape[:2], -1, np.int32)
    heuristic[2, ::2] = 0
    return pool, teams, heuristic, rollout.world.scenarios(keys(2))


def test_batches_and_threads_do_not_change_a_bit(case, rollout):
    pool, teams, heuristic, scenarios = batch_of(rollout)
    whole = rollout.evaluate(pool, teams, scenarios, heuristic)
    assert n_different(whole) > 4
    for other in (
        Rollout(*case, n_threads=3),
        batched(Rollout(*case, n_threads=1), 4),  # two teams at once, in the end one
        batched(Rollout(*case, n_threads=2), 1),
    ):
        assert_same_bits(whole, other.evaluate(pool, teams, scenarios, heuristic))


def test_lanes_do_not_change_a_bit(case_in_lanes, cpu_blocks):
    one = Rollout(*case_in_lanes, n_threads=1)
    pool, teams, heuristic, scenarios = batch_of(one)
    whole = one.evaluate(pool, teams, scenarios, heuristic)
    with cpu_blocks():
        block = Rollout(*case_in_lanes, n_threads=1, lanes=8)
        assert_same_bits(whole, block.evaluate(pool, teams, scenarios, heuristic))
        assert_same_records(*(x.record(pool, teams[0], scenarios_of(x)) for x in (one, block)))


def n_different(outcome):
    """Return how many of the teams did anything else than all others, or elsewhere."""
    pairs = zip(outcome.counts, outcome.fitness, strict=True)
    return len({(counts.tobytes(), fitness.tobytes()) for counts, fitness in pairs})


def scenarios_of(rollout):
    return rollout.world.scenarios(keys(1))


def assert_same_records(a, b):
    assert a.keys() == b.keys()
    for name, values in a.items():
        assert values.tobytes() == b[name].tobytes(), name


def test_a_robot_remembers_nothing_at_the_start_of_an_epoch(case, rollout):
    """Weights and memory left in the same workspace by another team change nothing."""
    pool, teams = teams_of(rollout, 4)
    fresh = Rollout(*case, n_threads=1).record(pool, teams[0], scenarios_of(rollout))
    rollout.evaluate(pool, teams[::-1], rollout.world.scenarios(keys(2)))
    for struct in (rollout._workspace.weights, rollout._workspace.memory):
        for name in struct._cls.vars:
            getattr(struct, name).numpy()[:] = 3  # as if all slots had been in use
    for _ in range(2):
        assert_same_records(fresh, rollout.record(pool, teams[0], scenarios_of(rollout)))
    out = Rollout(*case, n_threads=1).evaluate(pool, teams, scenarios_of(rollout))
    assert_same_bits(out, rollout.evaluate(pool, teams, scenarios_of(rollout)))


@pytest.mark.parametrize("n_worlds", [512, 5, 1])
def test_rounds_at_once_equal_a_call_for_each_bit_for_bit(case, rollout, n_worlds):
    """Also where batches end within a round."""
    pool, teams = teams_of(rollout, 9)
    heuristic = np.full(teams.shape[:2], -1, np.int32)
    heuristic[4], heuristic[8, 1] = 0, 0
    met = keys(6)
    scenarios = rollout.world.scenarios(met)
    at_once = batched(rollout, n_worlds).evaluate(pool, teams, scenarios, heuristic, rounds=3)
    alone = Rollout(*case, n_threads=1)
    outcomes = []
    for k in range(3):
        some = slice(3 * k, 3 * k + 3)
        own: Scenarios = rollout.world.scenarios(met[2 * k : 2 * k + 2])
        outcomes.append(alone.evaluate(pool, teams[some], own, heuristic[some]))
        assert at_once.fitness[some].tobytes() == outcomes[k].fitness.tobytes()
        assert at_once.counts[some].tobytes() == outcomes[k].counts.tobytes()
        assert at_once.switches[some].tobytes() == outcomes[k].switches.tobytes()
        for name, values in outcomes[k].performance.items():
            assert at_once.performance[name][some].tobytes() == values.tobytes(), name
    # The rounds differ: the other teams get other results in the scenarios of the first one.
    again = alone.evaluate(pool, teams[3:6], rollout.world.scenarios(met[:2]), heuristic[3:6])
    assert again.counts.tobytes() != outcomes[1].counts.tobytes()


def test_unequal_rounds_are_refused(rollout):
    pool, teams = teams_of(rollout, 4)
    for n_scenarios, n_teams in ((3, 4), (4, 3)):
        scenarios = rollout.world.scenarios(keys(n_scenarios))
        with pytest.raises(ValueError, match="not 2 rounds"):
            rollout.evaluate(pool, teams[:n_teams], scenarios, rounds=2)


# --- settings -----------------------------------------------------------------------------------


@pytest.mark.parametrize("path", WORLDS)
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n_hidden": 0}, "n_hidden"),
        ({"n_hidden": 17}, "n_hidden"),
        ({"n_hidden": 2.5}, "n_hidden"),
        ({"max_hidden": 33}, "max_hidden"),
        ({"n_hidden": 5, "max_hidden": 4}, "max_hidden (4) must not be below n_hidden (5)"),
        ({"max_hidden": 3}, "max_hidden (3) must not be below n_hidden"),
        ({"weight_scale": 0}, "weight_scale"),
        ({"weight_scale": float("nan")}, "weight_scale"),
        ({"recurrent": "maybe"}, "recurrent"),
        ({"n_hiden": 5}, "did you mean 'controller.n_hidden'?"),
    ],
)
def test_wrong_settings_of_a_network_are_refused_in_one_line(path, settings, words):
    with pytest.raises(UsageError) as caught:
        resolve(path, overrides={f"controller.{name}": value for name, value in settings.items()})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_controller_names_the_nearest():
    for call in (
        lambda: controller("snr"),
        lambda: resolve("rover/complex-5", overrides={"controller.name": "snr"}),
    ):
        with pytest.raises(UsageError, match=r"'snr'.*did you mean 'srn'") as caught:
            call()
        assert "\n" not in str(caught.value)


def test_a_runs_setting_overrides_the_worlds_which_overrides_the_default():
    a_world = world("gacc/complex-9")
    assert a_world.controller["bias"] is True
    assert controller().bias is False
    assert controller(world=a_world).bias is True
    assert controller(world=a_world, bias=False).bias is False
    assert controller(world=world("pursuit/team-3"), n_hidden=4).max_hidden == 12
