"""The pursuit worlds: symmetries, invariants of random play, scenarios and parameters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.rng import fold, stream
from conevo.runs.config import resolve
from conevo.worlds.pursuit.arena import draw_scenarios
from conevo.worlds.pursuit.prey_sets import PreySet, save
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from worlds.situations import (
    AHEAD,
    FORWARD,
    IDLE,
    LEFT,
    NAN,
    PI,
    REVERSE,
    RIGHT,
    STOP,
    drivers,
    placed,
    random_prey_file,
    random_team,
)

# --- symmetries ---------------------------------------------------------------------------------


SYMMETRIC = [("team-3", "heuristic", 3), ("team-10", "file", 4), ("team-8", "heuristic", 5)]


@pytest.fixture(scope="module")
def networks(tmp_path_factory):
    """A file of prey that are random networks."""
    return random_prey_file(tmp_path_factory.mktemp("prey") / "random.npz", 4)


@pytest.mark.parametrize(("environment", "prey", "seed"), SYMMETRIC)
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_arena_is_a_turned_outcome(environment, prey, seed, turns, networks):
    prey = networks if prey == "file" else prey
    a_world = world(
        f"pursuit/{environment}", prey=prey, iterations=40, n_obstacles=3, arena_cm=70.0
    )
    genes, slots = random_team(a_world, seed)
    scenarios = a_world.scenarios([fold(seed, "turned")])

    def turned(x, y):
        for _ in range(turns):
            x, y = 70 - y, x
        return x, y

    x, y = turned(scenarios.x, scenarios.y)
    ox, oy = turned(scenarios.obstacle_x, scenarios.obstacle_y)
    other = replace(
        scenarios,
        x=x,
        y=y,
        obstacle_x=ox,
        obstacle_y=oy,
        heading=(scenarios.heading + np.float32(turns * PI / 2) + PI) % (2 * PI) - np.float32(PI),
    )
    seen, after = (Rollout(a_world).record(genes, slots, s) for s in (scenarios, other))
    assert seen["collided"].any()
    x, y = turned(seen["x"], seen["y"])
    assert np.abs(after["x"] - x).max() < 0.01
    assert np.abs(after["y"] - y).max() < 0.01
    assert np.array_equal(seen["collided"], after["collided"])
    assert np.array_equal(seen["captured"], after["captured"])
    for name in ("inputs", "hidden"):
        assert np.abs(seen[name] - after[name]).max() < 0.01, name


MIRROR = [7, 6, 5, 4, 3, 2, 1, 0]  # a sensor's partner on the other side


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_mirrored_arena_with_mirrored_networks_is_a_mirrored_outcome(seed, networks):
    a_world = world("pursuit/team-9", prey=networks, iterations=40, n_obstacles=3, arena_cm=70.0)
    genes, slots = random_team(a_world, seed)
    scenarios = a_world.scenarios([fold(seed, "mirrored")])
    order = [*MIRROR, *(8 + k for k in MIRROR), *range(16, 22), 23, 22]
    other = replace(
        scenarios,
        y=70 - scenarios.y,
        obstacle_y=70 - scenarios.obstacle_y,
        heading=-scenarios.heading,
        prey_in=scenarios.prey_in[:, MIRROR],
        prey_out=scenarios.prey_out[:, ::-1],
    )
    rollout = Rollout(a_world)
    seen, after = rollout.record(genes, slots, scenarios), rollout.record(
        genes[:, order], slots, other
    )  # fmt: skip
    assert seen["collided"].any()
    assert np.abs(after["x"] - seen["x"]).max() < 0.01
    assert np.abs(after["y"] - (70 - seen["y"])).max() < 0.01
    assert np.abs(np.sin((after["heading"] + seen["heading"]) / 2)).max() < 0.01
    assert np.abs(after["inputs"][:, :, order[:16]] - seen["inputs"]).max() < 0.01
    assert np.abs(after["hidden"] - seen["hidden"]).max() < 0.01
    assert np.array_equal(seen["collided"], after["collided"])
    swapped = np.array([STOP, FORWARD, RIGHT, LEFT, REVERSE])[after["action"]]
    assert (swapped == seen["action"]).mean() > 0.99


def test_relabelling_predators_and_prey_relabels_the_outcome_exactly(networks):
    a_world = world("pursuit/team-10", prey=networks, iterations=150, arena_cm=60.0)
    genes, slots = random_team(a_world, 6)
    scenarios = a_world.scenarios([fold(6, "relabel")])
    order = stream(6, "order").permutation(6)
    bodies = np.array([*order, 7, 6])
    n = len(scenarios.prey_in) // 2
    other = replace(
        scenarios,
        **{k: getattr(scenarios, k)[:, bodies] for k in ("x", "y", "heading")},
        prey_in=np.roll(scenarios.prey_in, n, axis=0),
        prey_out=np.roll(scenarios.prey_out, n, axis=0),
    )
    rollout = Rollout(a_world)
    seen = rollout.record(genes, slots, scenarios)
    after = rollout.record(genes, slots[order], other)
    assert seen["collided"].sum() > 100
    for name in ("x", "y", "heading", "left", "right", "collided"):
        assert np.array_equal(seen[name][:, bodies], after[name]), name
    for name in ("action", "fitness", "inputs", "outputs", "hidden"):
        assert np.array_equal(seen[name][:, order], after[name]), name
    assert np.array_equal(seen["captured"][:, ::-1], after["captured"])


# --- invariants ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "params"),
    [
        ("pursuit/team-10", {"prey": "random", "arena_cm": 60.0, "n_obstacles": 6}),
        ("pursuit/team-4", {"prey": "heuristic", "arena_cm": 60.0, "max_speed_cm": 5.0}),
        ("pursuit/team-8", {"arena_cm": 1000.0}),
        ("prey/shaping-6", {"arena_cm": 60.0}),
        ("prey/shaping-2", {"max_speed_cm": 5.0}),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_no_body_leaves_the_arena_overlaps_or_outruns_its_wheels(path, params, seed):
    a_world = world(path, iterations=300, **params)
    genes, slots = random_team(a_world, seed, 1.0 if seed == 2 else 0.2)
    heuristic = np.full(a_world.n_robots, -1, np.int32)
    heuristic[seed - 1 :: 2] = 0
    scenarios = a_world.scenarios([fold(seed, "inside")])
    seen = Rollout(a_world).record(genes, slots, scenarios, heuristic)
    b, side = int(scenarios.n_bodies[0]), a_world.params.arena_cm
    places = np.stack([seen["x"][:, :b], seen["y"][:, :b]], axis=2)
    start = np.stack([scenarios.x[:, :b], scenarios.y[:, :b]], axis=2)
    places = np.concatenate([start, places]).astype(float)
    n = int(scenarios.n_obstacles[0])
    obstacles = np.stack([scenarios.obstacle_x[0, :n], scenarios.obstacle_y[0, :n]], axis=1)
    assert places.min() >= 2.75 - 1e-6
    assert places.max() <= side - 2.75 + 1e-4
    apart = np.hypot(*np.moveaxis(places[:, :, None] - places[:, None], 3, 0)) + 99 * np.eye(b)
    assert apart.min() >= 5.5 - 1e-4
    if n:
        assert np.hypot(*np.moveaxis(places[:, :, None] - obstacles, 3, 0)).min() >= 5.5 - 1e-4
    assert (np.abs(seen["heading"][:, :b]) <= np.float32(PI)).all()
    assert np.abs(seen["left"][:, :b]).max() <= 1
    is_prey = np.arange(b) >= a_world.n_robots
    if path.startswith("prey"):
        is_prey = ~is_prey
    top = a_world.params.max_speed_cm * np.where(is_prey, 1.2, 1.0)
    steps = np.hypot(*np.moveaxis(np.diff(places, axis=0), 2, 0))
    assert (steps <= top * (1 + 1e-4) + side * 2e-7).all()
    assert not steps[seen["collided"][:, :b] == 1].any()
    turns = np.diff(seen["heading"][:, :b], axis=0)
    assert not turns[seen["collided"][1:, :b] == 1].any()
    for name in ("inputs", "hidden"):
        assert ((seen[name] >= 0) & (seen[name] <= 1)).all()


def test_absent_bodies_leave_no_trace_of_other_teams():
    a_world = world("prey/shaping-2", iterations=20, least=1)
    genes, slots = random_team(a_world, 1)
    both = [a_world.scenarios([k]) for k in range(20)]
    few, many = (f(both, key=lambda s: s.n_bodies[0]) for f in (min, max))
    assert few.n_bodies[0] < many.n_bodies[0]
    fresh = Rollout(a_world).record(genes, slots, few)
    used = Rollout(a_world)
    used.record(genes, slots, many)
    for name, values in used.record(genes, slots, few).items():
        assert np.array_equal(values, fresh[name]), name


# --- scenarios ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "robots", "prey"),
    [(f"pursuit/team-{n}", 2 + (n - 1) % 5, 1 + (n > 5)) for n in range(1, 11)],
)
def test_team_types_of_table_4_2(path, robots, prey):
    a_world = world(path)
    assert a_world.n_robots == robots
    assert len(a_world.inputs) + controller(world=a_world).n_context == 22
    scenarios = a_world.scenarios([1])
    assert scenarios.n_bodies.tolist() == [robots + prey]
    assert scenarios.x.shape == (1, robots + prey)
    assert len(scenarios.prey_in) % prey == 0


def assert_free(scenarios, side):
    for e in range(len(scenarios)):
        b, n = scenarios.n_bodies[e], scenarios.n_obstacles[e]
        x = np.concatenate([scenarios.x[e, :b], scenarios.obstacle_x[e, :n]]).astype(float)
        y = np.concatenate([scenarios.y[e, :b], scenarios.obstacle_y[e, :n]]).astype(float)
        for places in (x, y):
            assert places.min() > 2.75
            assert places.max() < side - 2.75
        apart = np.hypot(x[:, None] - x, y[:, None] - y) + 99 * np.eye(len(x))
        assert apart.min() > 5.5


@pytest.mark.parametrize(
    ("path", "params", "side"),
    [
        ("pursuit/team-10", {}, 100.0),
        ("pursuit/team-10", {"arena_cm": 60.0, "n_obstacles": 6}, 60.0),
        ("pursuit/team-3", {"arena_cm": 1000.0}, 1000.0),
        ("prey/shaping-6", {"arena_cm": 60.0}, 60.0),
    ],
)
def test_starts_are_free_and_cover_the_arena(path, params, side):
    scenarios = world(path, **params).scenarios(range(300))
    assert_free(scenarios, side)
    b = scenarios.n_bodies.min()
    for places in (scenarios.x[:, :b], scenarios.y[:, :b]):
        quarters = np.histogram(places, bins=4, range=(0, side))[0] / places.size
        assert np.abs(quarters - 0.25).max() < 0.06
        assert places.max() > 0.9 * side
    turns = np.histogram(scenarios.heading[:, :b], bins=8, range=(-PI, PI))[0]
    n = turns.sum()
    assert n == scenarios.heading[:, :b].size
    assert np.abs(turns - n / 8).max() < 5 * math.sqrt(n / 8)


def test_scenarios_are_addressed_by_key():
    for path in ("pursuit/team-7", "prey/shaping-3"):
        a_world = world(path)
        one, two, both = (a_world.scenarios(k) for k in ([3], [4], [4, 3]))
        for name in ("x", "y", "heading", "n_bodies", "obstacle_x", "n_obstacles", "seed"):
            assert np.array_equal(getattr(one, name)[0], getattr(both, name)[1]), name
            assert np.array_equal(getattr(two, name)[0], getattr(both, name)[0]), name
        assert not np.array_equal(one.x, two.x)
        assert len(both) == 2


@pytest.mark.parametrize("experiment", range(1, 7))
def test_shaping_experiments_have_two_to_six_of_each(experiment):
    a_world = world(f"prey/shaping-{experiment}")
    robots = 1 + (experiment > 3)
    assert a_world.n_robots == robots
    assert (len(a_world.inputs), controller(world=a_world).n_context) == (8, 0)
    scenarios = a_world.scenarios(range(400))
    predators = np.bincount(scenarios.n_bodies - robots, minlength=7)
    obstacles = np.bincount(scenarios.n_obstacles, minlength=7)
    for counts, there in ((predators, experiment % 3 != 1), (obstacles, experiment % 3 != 2)):
        assert counts[:2].tolist() == [0 if there else 400, 0]
        if there:
            assert counts[2:].min() > 50  # 80 expected of each
    assert_free(scenarios, 100.0)


# --- parameters ---------------------------------------------------------------------------------


def test_defaults_and_the_printed_arena():
    p = world("pursuit/team-3").params
    assert (p.sensor_range_cm, p.prey_speed, p.iterations, p.prey) == (22.0, 1.2, 1000, "shaped")
    printed = resolve("pursuit/team-3", overrides={"world.arena_cm": 1000})
    assert printed.world_params.arena_cm == 1000
    a_world = world("pursuit/team-3", arena_cm=1000.0, iterations=30)
    start = a_world.scenarios([5])
    rollout = Rollout(a_world)
    genes, slots = drivers([AHEAD] * 4, rollout.genome)
    seen = rollout.record(genes, slots, start)
    ahead = start.x[0, :4] + 30 * 0.8 * np.cos(start.heading[0, :4])
    inside = (np.abs(ahead - 500) < 470) & (np.abs(start.y[0, :4] - 500) < 470)
    assert inside.any()
    assert np.allclose(seen["x"][-1, :4][inside], ahead[inside], atol=1e-2)


def prey_set(seed=1, slots=(5, 5)):
    rng = stream(seed, "prey")
    one, two = (
        rng.uniform(-1, 1, (n, u, 10)).astype(np.float32)
        for n, u in zip((1, 2), slots, strict=True)
    )
    active = np.ones((1, slots[0]), bool), np.ones((2, slots[1]), bool)
    return PreySet(one=one, two=two, one_active=active[0], two_active=active[1])


@pytest.fixture
def prey_file(tmp_path):
    path = tmp_path / "prey.npz"
    save(path, prey_set())
    return path


def refused(**overrides):
    """The one line with which a configuration is refused."""
    with pytest.raises(UsageError) as caught:
        resolve(
            "pursuit/team-1",
            overrides={f"world.{name}": value for name, value in overrides.items()},
        )
    line = str(caught.value)
    assert "\n" not in line
    return line


def test_a_prey_file_is_pinned_by_its_content(prey_file):
    config = resolve("pursuit/team-1", overrides={"world.prey": str(prey_file)})
    p = config.world_params
    assert p.prey_digest
    again = resolve(
        "pursuit/team-1",
        overrides={"world.prey": str(prey_file), "world.prey_digest": p.prey_digest},
    )
    assert again.run_id == config.run_id
    save(prey_file, prey_set(2))
    changed = resolve("pursuit/team-1", overrides={"world.prey": str(prey_file)})
    assert changed.run_id != config.run_id
    line = refused(prey=str(prey_file), prey_digest=p.prey_digest)
    assert "changed" in line
    assert p.prey_digest in line


@pytest.mark.parametrize("environment", ["team-1", "team-6"])
@pytest.mark.parametrize("slots", [(5, 5), (3, 6), (6, 3)])
def test_the_prey_of_a_file_are_used(tmp_path, environment, slots):
    """Also if the lone prey and the pair have different numbers of slots."""
    path, prey = tmp_path / "mine.npz", prey_set(3, slots)
    save(path, prey)
    a_world = world(f"pursuit/{environment}", prey=str(path), iterations=2)
    rollout = Rollout(a_world)
    genes, hidden = drivers([IDLE, IDLE], rollout.genome)
    scenarios = a_world.scenarios([1])
    q = scenarios.x.shape[1] - 2
    poses = [(10, 10, 0), (90, 10, 0), (30, 60, 0), (70, 60, 0)][: 2 + q]  # prey see nothing
    seen = rollout.record(genes, hidden, placed(a_world, poses, ()))
    networks = prey.one if q == 1 else prey.two
    sums = 10 * networks[:, :, 8:].sum(axis=1) * 0.5
    assert seen["left"][0, 2:] == pytest.approx(np.tanh(sums[:, 0] / 2), abs=1e-5)
    assert seen["right"][0, 2:] == pytest.approx(np.tanh(sums[:, 1] / 2), abs=1e-5)


def test_unknown_prey_names_the_nearest(tmp_path):
    line = refused(prey="heuristics")
    assert "heuristics" in line
    assert "heuristic" in line.replace("heuristics", "")
    missing = tmp_path / "none.npz"
    assert str(missing) in refused(prey=str(missing))
    assert "prey" in refused(prey=str(tmp_path))  # a folder
    assert "prey" in refused(prey="")


@pytest.mark.parametrize("damage", ["text", "torn", "empty", "other", "genes", "nan", "shape"])
def test_a_damaged_prey_file_is_refused_in_one_line(prey_file, damage):
    data = prey_file.read_bytes()
    good = prey_set()
    if damage == "text":
        prey_file.write_text("no prey\n")
    elif damage == "torn":
        prey_file.write_bytes(data[: len(data) // 2])
    elif damage == "empty":
        prey_file.write_bytes(b"")
    elif damage == "other":
        np.savez(prey_file, a=np.zeros(3))
    elif damage == "genes":
        save(prey_file, replace(good, one=good.one * 2))
    elif damage == "nan":
        save(prey_file, replace(good, two=good.two * np.float32("nan")))
    else:
        save(prey_file, replace(good, one=good.one[:, :, :9]))
    assert str(prey_file) in refused(prey=str(prey_file))


def test_a_digest_belongs_to_a_file(prey_file):
    assert "prey_digest" in refused(prey="heuristic", prey_digest="0123456789ab")
    assert "changed" in refused(prey=str(prey_file), prey_digest="0123456789ab")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("arena_cm", 10),
        ("arena_cm", NAN),
        ("sensor_angle_deg", 90),
        ("sensor_angle_deg", 0),
        ("max_speed_cm", 6),
        ("max_speed_cm", -1),
        ("prey_speed", 0),
        ("sensor_range_cm", float("inf")),
        ("n_obstacles", 7),
        ("capture_window", 0),
        ("capture_share", 1.5),
        ("capture_predators", 0),
        ("iterations", 0),
        ("prey", 3),
        ("arena", 100),
    ],
)
def test_bad_parameters_are_refused_in_one_line(name, value):
    assert name in refused(**{name: value})


def test_impossible_scenarios_are_refused_in_one_line():
    with pytest.raises(UsageError, match="arena of 10 cm has no room for"):
        draw_scenarios([1], 10.0, 4, (1, 1), (0, 0), n_sensors=16)
    with pytest.raises(UsageError, match=r"capture_predators \(3\) must not be above the 2 pred"):
        world("pursuit/team-1", capture_predators=3)


def test_a_file_without_a_prey_set_is_refused_without_advice_to_unpickle_it(tmp_path):
    path = tmp_path / "prey.toml"
    path.write_text("format = 1")
    with pytest.raises(UsageError) as caught:
        world("pursuit/team-1", prey=str(path))
    assert "prey.toml is damaged or not a prey set" in str(caught.value)
    assert "pickle" not in str(caught.value)
