"""The gathering world: environments, scenarios, sensors, invariants of play, symmetries."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from conevo.controllers.registry import controller, genome_of
from conevo.errors import UsageError
from conevo.rng import fold, stream
from conevo.runs.config import resolve
from conevo.worlds.measures import measures_of
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from oracles import gacc_oracle
from worlds.gacc_invariants import check_epoch, is_home, within
from worlds.gathering import IDLE, SMALL, STEP, crowded, gathering, random_team, team

# --- environments -------------------------------------------------------------------------------

# Tables 6.6 (as settled) and 6.8: sequences, with a * if the order is free; obstacles.
ENVIRONMENTS = {
    "simple-1": ("A" * 10, 0),
    "simple-2": ("B" * 10, 0),
    "simple-3": ("C" * 10, 0),
    "simple-4": (" ".join(["A" * 10] * 2), 0),
    "simple-5": (" ".join(["B" * 10] * 2), 0),
    "simple-6": (" ".join(["C" * 10] * 2), 0),
    "simple-7": (" ".join(["A" * 10] * 3), 0),
    "simple-8": (" ".join(["B" * 10] * 3), 0),
    "simple-9": (" ".join(["C" * 10] * 3), 0),
    "simple-10": (" ".join(["A" * 10] * 4), 0),
    "complex-1": ("CCACBCBCCC*", 0),
    "complex-2": ("CAACBBBCBC*", 10),
    "complex-3": ("BABAABCBBB", 10),
    "complex-4": ("BAABAACAAC ACCCCCCCCA*", 10),
    "complex-5": ("BAABAABAAB CACACACACC", 10),
    "complex-6": ("BAAAAAAAAB CABBBBBBAC CBBBBBBBBC*", 10),
    "complex-7": ("CACACBCBCB CABABABABB BABABABACC", 10),
    "complex-8": ("BABACABACB CACACABABC BABABABACB CABACABABC*", 10),
    "complex-9": ("BABACABABB CACACABABB BABABABACB BABABBBABB", 10),
}


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_plans_of_all_environments(environment):
    text, n_obstacles = ENVIRONMENTS[environment]
    sequences = text.split()
    a_world = world(f"gacc/{environment}")
    assert a_world.plan.is_ordered == tuple(not s.endswith("*") for s in sequences)
    s = a_world.scenarios([1, 2])
    plans = ["".join("ABC"[x] for x in parts) for parts in s.plan]
    assert plans == [one.rstrip("*") for one in sequences]
    letters = "".join("ABC"[x] for x in s.object_type[0])
    assert letters == "".join(sorted("".join(plans)))  # exactly the parts, A first
    assert s.left.shape == (2, n_obstacles)
    assert s.start_x.shape == (2, 30)
    assert len(letters) <= 64  # kernels keep sets of objects and obstacles as bits of a word
    assert n_obstacles <= 64


def test_names_and_sizes():
    a_world = world("gacc/complex-9")
    assert a_world.n_robots == 30
    assert a_world.params.iterations == 3000
    mind = controller(world=a_world)
    sizes = (len(a_world.inputs), mind.n_context, mind.n_hidden, len(a_world.outputs))
    assert sizes == (27, 10, 10, 8)
    assert (genome_of(mind, a_world).n_genes, mind.bias) == (45, True)
    assert list(a_world.heuristics) == gacc_oracle.HEURISTICS
    assert len(a_world.actions) == 7
    kinds = ("detector", "gatherer", "constructor")
    detectors, gatherers, constructors = ([f"{x}-{kind}" for x in "ABC"] for kind in kinds)
    assert list(a_world.castes) == [*detectors, "non-specialized", *gatherers, *constructors]
    names = [one.name for one in measures_of(a_world)]
    assert names == ["delivered", "completed", "delivered_share"]


# --- scenarios ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("environment", "params"),
    [
        ("simple-10", {}),
        ("complex-1", {"home_side": 0.8}),
        ("complex-9", {}),
        ("complex-3", {"home_side": 0.2}),
        ("complex-5", {"obstacle_most": 0.03, "obstacle_gap": 0.05, "separation": 0.02}),
        ("complex-2", {"obstacle_least": 0.1, "home_side": 0.3, "n_robots": 64}),
    ],
)
def test_everything_starts_in_allowed_places(environment, params):
    a_world = world(f"gacc/{environment}", **params)
    p = a_world.params
    s = a_world.scenarios(range(40))
    half = np.float32(p.home_side / 2)
    for x, y in ((s.start_x, s.start_y), (s.object_x, s.object_y)):
        assert x.min() >= 0
        assert y.max() < 1
        assert not is_home(x, y, half).any()
        for e in range(len(s)):
            assert not within(s, x[e], y[e], e).any()
        quarters = np.histogram2d(x.ravel(), y.ravel(), bins=2, range=[[0, 1], [0, 1]])[0]
        assert np.abs(quarters / x.size - 0.25).max() < 0.06
    gaps = np.hypot(s.start_x[:, :, None] - s.start_x[:, None],
                    s.start_y[:, :, None] - s.start_y[:, None])  # fmt: skip
    assert (gaps + np.eye(a_world.n_robots)).min() >= p.separation * (1 - 1e-5)
    low, high = np.stack([s.left, s.bottom], axis=2), np.stack([s.right, s.top], axis=2)
    if not s.left.size:
        return
    assert (high - low).min() >= p.obstacle_least - 1e-6
    assert (high - low).max() <= p.obstacle_most + 1e-6
    assert low.min() >= p.obstacle_gap - 1e-6  # from the walls
    assert high.max() <= 1 - p.obstacle_gap + 1e-6
    for e in range(len(s)):
        home = np.array([[0.5 - half] * 2]), np.array([[0.5 + half] * 2])
        a, b = (np.concatenate(both) for both in zip((low[e], high[e]), home, strict=True))
        apart = np.maximum(a[:, None] - b[None], a[None] - b[:, None]).max(axis=2)
        assert (apart + 9 * np.eye(len(a))).min() >= p.obstacle_gap - 1e-6


def test_scenarios_are_addressed_by_key():
    a_world = world("gacc/complex-6")
    one, two, both = (a_world.scenarios(k) for k in ([3], [4], [4, 3]))
    for name in (field.name for field in fields(one) if field.name != "plan"):
        assert np.array_equal(getattr(one, name)[0], getattr(both, name)[1]), name
        assert np.array_equal(getattr(two, name)[0], getattr(both, name)[0]), name
    assert not np.array_equal(one.object_x, two.object_x)
    assert not np.array_equal(one.left, two.left)
    assert not np.array_equal(one.start_x, two.start_x)
    assert len(both) == 2


# --- sensors by hand ----------------------------------------------------------------------------


def sensed(robots, objects, plans=("ABC",), **how):
    """Inputs [T, R, 27] of a situation."""
    how = {"iterations": 3} | how
    a_world, (genes, slots, scenarios, heuristic), _ = gathering(robots, objects, plans, **how)
    seen = Rollout(a_world, n_threads=1).record(genes, slots, scenarios, heuristic)
    return seen["inputs"]


@pytest.mark.parametrize("setting", "ABC")
def test_objects_are_sensed_after_an_activation_with_their_setting_only(setting):
    """An object of each type east, north and west of a robot, and two more a little farther."""
    objects = [(0.233, 0.201, "A"), (0.201, 0.24, "B"), (0.17, 0.201, "C"),
               (0.24, 0.201, "A"), (0.201, 0.245, "B")]  # fmt: skip
    robots = [(0.2, 0.2, [f"detect {setting}", "detect A", "detect B", "grip C", "detect C"])]
    inputs = sensed([*robots, (0.8, 0.8, IDLE)], objects, ["AABBC"], iterations=6)[:, 0]
    reading = {
        "A": np.eye(8)[0] * 1e-4 / (0.033**2 + 0.001**2) / 3,
        "B": np.eye(8)[1] * 1e-4 / (0.04**2 + 0.001**2) * 2 / 3,
        "C": np.eye(8)[3] * 1e-4 / (0.03**2 + 0.001**2),
    }
    assert not inputs[0, :8].any()
    for t, letter in ((1, setting), (2, "A"), (3, "B")):
        assert inputs[t, :8] == pytest.approx(reading[letter], rel=1e-4)
    assert not inputs[4, :8].any()  # a grip came before
    assert inputs[5, :8] == pytest.approx(reading["C"], rel=1e-4)


def test_obstacles_and_walls_are_sensed_and_hide_objects_behind_them():
    robots = [(0.2, 0.2, ["detect A"]), (0.2, 0.24, ["detect A"]), (0.03, 0.015, ["detect A"])]
    wall = [(0.19, 0.215, 0.23, 0.22)]
    objects = [(0.205, 0.235, "A"), (0.165, 0.2, "A")]
    inputs = sensed(robots, objects, ["AA"], obstacles=wall)
    # The object north of robot 0 is hidden, and so are the robots from each other.
    expected = np.zeros((3, 8))
    expected[0, [2, 4]] = -1e-4 / 0.015**2, 1e-4 / 0.035**2 / 3
    expected[1, [7, 6]] = 1 / 3, -1e-4 / 0.02**2  # 0.007 away counts as 0.01
    expected[2, [4, 6]] = -1e-4 / 0.03**2, -1e-4 / 0.015**2
    assert inputs[1, :, :8] == pytest.approx(expected, rel=1e-3)
    assert not inputs[:, :2, 8:16].any()


@pytest.mark.parametrize("bottom", [0.25, 0.2501])
def test_a_view_along_the_side_of_an_obstacle_is_blocked(bottom):
    """An obstacle is a closed set: the view is free only if a gap is left."""
    robots = [(0.25, 0.25, ["detect A"]), (0.29, 0.25, ["grip B"])]
    things = [(0.28, 0.25, "A"), (0.3, 0.25, "B")]
    inputs = sensed(robots, things, ["AB"], obstacles=[(0.26, bottom, 0.27, 0.3)])[1, 0]
    is_free = bottom > 0.25
    assert inputs[0] == pytest.approx(-1.0, rel=1e-3)  # its corner, in the octant of the object
    assert inputs[8] == pytest.approx(is_free * 2 / 3 * 1e-4 / 0.04**2, rel=1e-3)


def test_robots_show_what_they_carry():
    """Robot 1 in the east holds a B, robot 2 in the north a C; they are sensed one iteration on."""
    robots = [(0.2, 0.2, IDLE), (0.23, 0.201, ["grip B"]), (0.199, 0.225, ["grip C"]),
              (0.24, 0.201, ["grip A"]), (0.149, 0.2, ["grip A"])]  # fmt: skip
    things = [(0.235, 0.206, "B"), (0.2, 0.23, "C"), (0.245, 0.195, "A"), (0.145, 0.2, "A")]
    inputs = sensed(robots, things, ["AABC"])[:, 0, 8:16]
    assert not inputs[0].any()
    expected = np.zeros(8)
    expected[0] = 2 / 3 * 1e-4 / (0.03**2 + 0.001**2)  # not the A behind B
    expected[2] = 1e-4 / (0.001**2 + 0.025**2)  # and the A in the west is too far
    assert inputs[1] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("reach", [1.0, 0.25])
def test_home_is_sensed_in_one_octant(reach):
    robots = [(0.1, 0.48, IDLE), (0.5, 0.702, IDLE), (0.53, 0.5, IDLE), (0.701, 0.7, IDLE)]
    home = sensed(robots, [], home_range=reach)[0, :, 16:24]
    d = [math.hypot(0.4, 0.02), 0.202, 0.03, math.hypot(0.201, 0.2)]
    octants = [0, 6, 4, 4]
    for i in range(4):
        value = min(1.0, 0.1 / d[i]) if d[i] < reach else 0.0
        assert home[i] == pytest.approx(np.eye(8)[octants[i]] * value, rel=1e-4)


def test_accuracy_is_the_chance_to_see_each_thing():
    """One robot, one object, many iterations; walls have their own draws."""
    robots = [(0.03, 0.2, ["detect A"]), (0.8, 0.8, IDLE)]
    seen = {}
    for accuracy in (0.0, 0.3, 1.0):
        inputs = sensed(robots, [(0.06, 0.21, "A")], ["A"], iterations=1001,
                        object_accuracy=accuracy)  # fmt: skip
        seen[accuracy] = inputs[1:, 0, [0, 4]] != 0
        assert np.abs(seen[accuracy].mean(axis=0) - accuracy).max() < 0.07
    both = seen[0.3].all(axis=1).mean()
    assert both == pytest.approx(0.09, abs=0.05)
    assert seen[1.0].all()
    assert not seen[0.0].any()


# --- invariants ---------------------------------------------------------------------------------


@pytest.mark.parametrize("environment", ENVIRONMENTS)
@pytest.mark.parametrize("minds", ["networks", "heuristics"])
def test_no_object_is_duplicated_lost_or_delivered_against_the_plan(environment, minds):
    n = list(ENVIRONMENTS).index(environment)
    short = {"iterations": 250, "wait": 8, "energy": 6.513 if n % 3 == 2 else 1000.0}
    params = short | {"needs_detection": n % 2 == 0, "grip_distance": (0.02, 0.04)[n % 2]}
    a_world = world(f"gacc/{environment}", **(SMALL | params))
    seed = fold(n, minds)
    scenarios = crowded(a_world.scenarios([seed]), seed, 0.3, 0.26)
    genes, slots = random_team(a_world, seed)
    heuristic = np.full(30, -1, np.int32)
    if minds == "heuristics":
        heuristic = (np.arange(30) % 10).astype(np.int32)
    rollout = Rollout(a_world, n_threads=1)
    seen = rollout.record(genes, slots, scenarios, heuristic)
    check_epoch(a_world, scenarios, seen)
    out = rollout.evaluate(genes, slots[None], scenarios, heuristic[None])
    delivered = int((seen["part"][-1] >= 0).sum())
    k = seen["part"].shape[1]
    built = np.bincount(seen["part"][-1][seen["part"][-1] >= 0] // 10, minlength=k // 10)
    performance = {name: float(v[0, 0]) for name, v in out.performance.items()}
    share = 100 * delivered / k
    assert performance == pytest.approx(
        {"delivered": delivered, "completed": (built == 10).sum(), "delivered_share": share}
    )
    assert out.fitness[0, 0].tolist() == seen["fitness"][-1].tolist()
    if minds == "heuristics":
        assert delivered > 0


def test_a_drawn_start_with_the_defaults_keeps_the_invariants_too():
    a_world = world("gacc/complex-7", iterations=800)
    genes, slots = random_team(a_world, 3)
    heuristic = (np.arange(30) % 10).astype(np.int32)
    for key in (1, 2):
        scenarios = a_world.scenarios([key])
        check_epoch(a_world, scenarios, Rollout(a_world).record(genes, slots, scenarios, heuristic))


# --- symmetries ---------------------------------------------------------------------------------

ROBOTS = ("x", "y", "energy", "fitness", "action", "held", "waited", "dropped", "situation")
OBJECTS = ("object_x", "object_y", "life", "detected", "part", "demand")


def scripted(seed, turn):
    """Robots with random scripts and objects around the home area, all turned by a map."""
    rng = stream(seed, "scripted")
    kinds = [f"{verb} {letter}" for verb in ("detect", "grip", "grip") for letter in "ABC"]
    places = 0.5 + rng.uniform(-0.12, 0.12, (44, 2))
    minds = []
    for _ in range(24):
        steps = rng.uniform(-STEP, STEP, (10, 2))
        words = rng.integers(0, 2 * len(kinds), 10)
        minds.append([kinds[w] if w < len(kinds) else s for w, s in zip(words, steps, strict=True)])
    turned = [
        [phase if isinstance(phase, str) else turn(*phase) for phase in mind] for mind in minds
    ]
    at = [tuple(0.5 + np.array(turn(*(p - 0.5)))) for p in places]
    robots = [(*p, mind) for p, mind in zip(at[:24], turned, strict=True)]
    objects = [(*p, letter) for p, letter in zip(at[24:], "AABBABCACB" * 2, strict=True)]
    return gathering(robots, objects, ["AABBABCACB", "AABBABCACB"], ordered="od", iterations=60)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("turn", "octants"),
    [
        (lambda x, y: (-y, x), [(o + 2) % 8 for o in range(8)]),
        (lambda x, y: (-x, -y), [(o + 4) % 8 for o in range(8)]),
        (lambda x, y: (-x, y), [(3 - o) % 8 for o in range(8)]),
    ],
    ids=["quarter", "half", "mirror"],
)
def test_a_turned_world_is_a_turned_outcome(seed, turn, octants):
    (a_world, first, _), (_, second, _) = (scripted(seed, f) for f in (lambda x, y: (x, y), turn))
    seen, after = (Rollout(a_world).record(*rest) for rest in (first, second))
    assert (seen["part"][-1] >= 0).sum() >= 3
    for x, y in (("x", "y"), ("object_x", "object_y")):
        free = seen["life"] != gacc_oracle.DELIVERED if x == "object_x" else True
        tx, ty = turn(seen[x] - 0.5, seen[y] - 0.5)
        assert np.abs(np.where(free, after[x] - 0.5 - tx, 0)).max() < 1e-4
        assert np.abs(np.where(free, after[y] - 0.5 - ty, 0)).max() < 1e-4
    for name in (*ROBOTS[3:], *OBJECTS[2:], "counts"):
        assert np.array_equal(seen[name], after[name]), name
    for group in range(3):
        group_of = slice(8 * group, 8 * group + 8)
        a, b = seen["inputs"][:, :, group_of], after["inputs"][:, :, group_of]
        assert np.abs(b[:, :, octants] - a).max() < 1e-2


def test_relabelling_the_robots_relabels_the_outcome():
    """Without bodies, and if no two grip one object outside in the same iteration."""
    params = SMALL | {"iterations": 150, "separation": 0.0, "home_sight": 0.1}
    a_world = world("gacc/complex-8", **params)
    genes, slots = random_team(a_world, 5)
    scenarios = crowded(a_world.scenarios([5]), 5, 0.2, 0.2)
    order = stream(5, "order").permutation(30)
    other = replace(
        scenarios,
        start_x=scenarios.start_x[:, order].copy(),
        start_y=scenarios.start_y[:, order].copy(),
    )
    seen = Rollout(a_world).record(genes, slots, scenarios)
    after = Rollout(a_world).record(genes, slots[order], other)
    assert seen["fitness"][-1].sum() > 20
    for name in (*ROBOTS, "inputs", "outputs", "hidden"):
        assert np.array_equal(seen[name][:, order], after[name]), name
    for name in OBJECTS:
        assert np.array_equal(seen[name], after[name]), name


def test_objects_of_one_type_are_alike():
    """Their numbers only determine the order: renumbered objects end in the same states."""
    robots = [(0.5 + 0.02 * math.cos(a), 0.5 + 0.02 * math.sin(a), IDLE) for a in range(6)]
    things = [(0.5, 0.5, "A"), (0.535, 0.5, "A"), (0.47, 0.48, "A"), (0.5, 0.45, "B")]
    results = []
    for order in ([0, 1, 2, 3], [2, 0, 1, 3], [1, 2, 0, 3]):
        a_world, rest, numbers = gathering(robots, [things[n] for n in order], ["AAAB"])
        seen = Rollout(a_world).record(*rest)
        where = [numbers[order.index(n)] for n in range(4)]
        results.append((seen["x"].tolist(), seen["life"][:, where].tolist()))
    assert results[0] == results[1] == results[2]


# --- parameters ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_robots", 1),
        ("n_robots", 65),
        ("iterations", 1),
        ("energy", 0),
        ("energy", float("nan")),
        ("home_side", 0),
        ("home_side", 0.81),
        ("home_sight", 0),
        ("home_sight", 1.1),
        ("zone_side", 0.51),
        ("home_range", 0),
        ("object_range", 0.6),
        ("object_range", float("inf")),
        ("object_accuracy", 1.1),
        ("object_cost", -1),
        ("robot_range", 0),
        ("robot_cost", -0.1),
        ("grip_distance", 0),
        ("grip_cost", -0.1),
        ("move_range", 0.03),
        ("move_cost", -0.1),
        ("wait", 0),
        ("wait", 1.5),
        ("needs_detection", "maybe"),
        ("min_distance", 0),
        ("separation", -0.1),
        ("obstacle_least", 0.01),
        ("obstacle_least", 0.11),
        ("obstacle_most", 0.2),
        ("obstacle_most", 0.019),
        ("obstacle_gap", 0),
        ("home", 0.2),
    ],
)
def test_bad_parameters_are_refused_in_one_line(name, value):
    with pytest.raises(UsageError) as caught:
        resolve("gacc/complex-1", overrides={f"world.{name}": value})
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "params",
    [
        {"zone_side": 0.31, "home_side": 0.3},
        {"obstacle_least": 0.06, "obstacle_most": 0.05},
    ],
)
def test_parameters_that_contradict_each_other_are_refused(params):
    with pytest.raises(UsageError) as caught:
        world("gacc/complex-3", **params)
    assert all(name in str(caught.value) for name in params)
    assert "\n" not in str(caught.value)


def test_obstacles_that_have_no_room_are_refused():
    a_world = world("gacc/complex-9", home_side=0.8, obstacle_least=0.1)
    with pytest.raises(UsageError, match="no room for 10 obstacles") as caught:
        a_world.scenarios([1])
    assert "\n" not in str(caught.value)


def test_robots_that_have_no_room_are_refused():
    with pytest.raises(UsageError, match="no room for 30 places"):
        world("gacc/simple-1", separation=0.3).scenarios([1])


def test_environments_that_do_not_exist_name_the_nearest():
    with pytest.raises(UsageError, match="complex-"):
        world("gacc/complex-10")
    with pytest.raises(UsageError, match="gacc/simple-1"):
        world("gacc")


def test_ties_of_outputs_go_to_the_first():
    """All outputs of a network without neurons are equal."""
    a_world, (genes, slots, scenarios, heuristic), _ = gathering(
        [(0.2, 0.2, IDLE), (0.8, 0.8, IDLE)], [], ["A"]
    )
    slots[0] = -1
    seen = Rollout(a_world).record(genes, slots, scenarios, heuristic)
    assert seen["action"].tolist() == [[0, 2]] * 12


def test_teams_of_scripts_execute_them():
    """The controllers made by hand that steer the robots in these tests."""
    phases = ["detect B", "grip C", (STEP, -0.002), (-STEP, -STEP), (0.0, 0.006), "detect A"]
    a_world, rest, _ = gathering([(0.2, 0.2, phases), (0.8, 0.8, IDLE)], [], ["A"])
    genome = genome_of(controller(world=a_world), a_world)
    genes, slots, heuristic = team([(0, 0, phases), (0, 0, "B-gatherer")], genome)
    assert slots[0, : len(phases)].tolist() == list(range(6))
    assert heuristic.tolist() == [-1, 4]
    assert np.abs(genes).max() <= 1
    seen = Rollout(a_world).record(*rest)
    assert seen["action"][:, 0].tolist() == [1, 6, 3, 3, 3] + [0] * 7
    steps = np.diff(np.stack([seen["x"][:, 0], seen["y"][:, 0]], axis=1), axis=0)[1:4]
    assert np.abs(steps - [phase for phase in phases if isinstance(phase, tuple)]).max() < 1e-6
