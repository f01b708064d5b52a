"""Small cases of the multi-rover world, solved by hand and checked on its slow oracle."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from conevo.worlds.rover.canals import load, sites
from oracles import rover_oracle as oracle
from oracles.rover_oracle import HI, LOW, MED, MOVE, NONE, Params, activate, step_towards

SETTINGS = {"l": LOW, "m": MED, "h": HI}
EAST, NORTH, WEST = step_towards(0.0), step_towards(math.pi / 2), step_towards(math.pi)
OPEN = np.zeros((200, 200), np.bool_)


class Script:
    """A controller that plays outputs one after another, then repeats the last."""

    def __init__(self, *outputs: Sequence[float]) -> None:
        self.outputs = outputs
        self.calls = 0

    def __call__(self, t: int, sensors: np.ndarray) -> Sequence[float]:
        self.calls += 1
        return self.outputs[min(t, len(self.outputs) - 1)]


def play(
    controllers: Sequence[oracle.Controller],
    start: Sequence[tuple[float, float]],
    rocks: Sequence[tuple[float, float, str]] = (),
    mask: np.ndarray = OPEN,
    uniform: oracle.Uniform = lambda t, rock, rover: 0.0,  # every detection succeeds
    **params: object,
) -> dict[str, np.ndarray]:
    types = np.array(["ABCDE".index(kind) for *_, kind in rocks], int)
    values = np.array([1, 2, 3, 4, 1])[types]
    x, y = (np.array([rock[i] for rock in rocks], float) for i in (0, 1))
    p = replace(Params(iterations=1), **params)  # type: ignore[arg-type]
    return oracle.run(p, controllers, x, y, types, values, mask, np.array(start), uniform)


def team(settings: str) -> list[Script]:
    return [Script(activate(SETTINGS[s])) for s in settings]


PAIR = [(0.5, 0.5), (0.51, 0.5)]
ROCK = (0.505, 0.52)  # 0.005 and 0.02 away from both of PAIR

# Centres of 0.01 cells within 0.07 of a cell corner, in half cells: (odd)^2 + (odd)^2 < 14^2.
LOW_DISC = sum(i * i + j * j < 14**2 for i in range(-99, 100, 2) for j in range(-99, 100, 2))


# --- detection and credit -----------------------------------------------------------------------


def test_two_low_rovers_detect_an_a_rock_and_both_are_credited() -> None:
    end = play(team("ll"), PAIR, [(*ROCK, "A")])
    assert end["detected"].tolist() == [0]
    assert LOW_DISC == 156  # pi 7^2 = 153.9
    expected = 1.0 * (LOW_DISC / 10_000) / (0.005**2 + 0.02**2)
    np.testing.assert_allclose(end["fitness"], [expected, expected], rtol=1e-12)
    assert end["credited"].tolist() == [1.0, 1.0]


def test_the_distance_in_the_fitness_is_bounded_below() -> None:
    end = play(team("hh"), PAIR, [(0.5, 0.503, "D")])
    disc = sum(i * i + j * j < 6**2 for i in range(-9, 10, 2) for j in range(-9, 10, 2)) / 10_000
    expected = [4.0 * disc / 0.01**2, 4.0 * disc / (0.01**2 + 0.003**2)]
    np.testing.assert_allclose(end["fitness"], expected, rtol=1e-12)


DETECTS = {"A": {"ll"}, "B": {"lm"}, "C": {"mh"}, "D": {"hh"}, "E": {"ll", "mm", "hh"}}


@pytest.mark.parametrize("settings", ["ll", "lm", "lh", "mm", "mh", "hh"])
@pytest.mark.parametrize("kind", "ABCDE")
def test_only_complementary_settings_detect(kind: str, settings: str) -> None:
    for order in (settings, settings[::-1]):
        end = play(team(order), PAIR, [(*ROCK, kind)])
        assert bool(end["detected"][0] == 0) == (settings in DETECTS[kind])
        assert bool(np.all(end["fitness"] > 0)) == (settings in DETECTS[kind])
        assert bool(np.any(end["fitness"] > 0)) == (settings in DETECTS[kind])


@pytest.mark.parametrize("kind", "ABCDE")
def test_a_lone_rover_detects_nothing(kind: str) -> None:
    for setting in "lmh":
        end = play(team(setting), PAIR[:1], [(*ROCK, kind)])
        assert end["detected"].tolist() == [-1]
        assert end["fitness"].tolist() == [0.0]


def test_both_rovers_must_act_in_the_same_iteration() -> None:
    late = [Script(activate(LOW), NORTH), Script(NORTH, activate(LOW))]
    end = play(late, PAIR, [(*ROCK, "A")], iterations=2)
    assert end["detected"].tolist() == [-1]


@pytest.mark.parametrize(("settings", "credited"), [("llm", [1, 1, 0]), ("lll", [1, 1, 1])])
def test_every_member_of_a_pair_is_credited_and_no_other(
    settings: str, credited: list[int]
) -> None:
    end = play(team(settings), [*PAIR, (0.49, 0.5)], [(*ROCK, "A")])
    assert end["credited"].tolist() == credited


def test_two_pairs_share_a_member() -> None:
    end = play(team("lml"), [*PAIR, (0.49, 0.5)], [(*ROCK, "B")])
    assert end["credited"].tolist() == [2.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("setting", "inside", "outside"),
    [("l", 0.069, 0.071), ("m", 0.049, 0.051), ("h", 0.029, 0.031)],
)
def test_both_rovers_must_be_in_range(setting: str, inside: float, outside: float) -> None:
    start = [(0.5, 0.5), (0.5, 0.52)]
    for distance, found in ((inside, 0), (outside, -1)):
        rock = (0.5, 0.5 + distance, "E")
        assert play(team(setting * 2), start, [rock])["detected"].tolist() == [found]


def test_the_range_is_strict() -> None:
    start = [(0.25, 0.5), (0.5, 0.75)]
    rock = [(0.5, 0.5, "A")]  # exactly 0.25 from both, exact in binary
    for reach, found in ((0.25, -1), (0.2501, 0)):
        end = play(team("ll"), start, rock, ranges=(reach, 0.05, 0.03))
        assert end["detected"].tolist() == [found]


@pytest.mark.parametrize(("setting", "accuracy"), [("l", 0.7), ("m", 0.8), ("h", 0.9)])
def test_both_rovers_must_succeed(setting: str, accuracy: float) -> None:
    for draws, found in (
        ([accuracy - 1e-9, accuracy - 1e-9], 0),
        ([accuracy - 1e-9, accuracy], -1),
        ([accuracy, accuracy - 1e-9], -1),
    ):
        end = play(team(setting * 2), PAIR, [(*ROCK, "E")], uniform=lambda t, k, v, d=draws: d[v])
        assert end["detected"].tolist() == [found]


def test_every_rock_has_its_own_draw() -> None:
    succeeds = {(0, 1), (1, 0)}  # (iteration, rock)
    end = play(
        team("ll"),
        PAIR,
        [(*ROCK, "A"), (0.505, 0.521, "A"), (0.505, 0.522, "A")],
        uniform=lambda t, rock, rover: 0.0 if (t, rock) in succeeds else 0.99,
        iterations=3,
    )
    assert end["detected"].tolist() == [1, 0, -1]


def test_a_rock_is_detected_once() -> None:
    once = play(team("ll"), PAIR, [(*ROCK, "A")], iterations=1)
    often = play(team("ll"), PAIR, [(*ROCK, "A")], iterations=5)
    assert often["detected"].tolist() == [0]
    assert often["fitness"].tolist() == once["fitness"].tolist()


# --- score --------------------------------------------------------------------------------------


def test_the_lander_records_one_iteration_later() -> None:
    rock = [(*ROCK, "A")]
    assert play(team("ll"), PAIR, rock, iterations=1)["value"] == 0.0
    assert play(team("ll"), PAIR, rock, iterations=2)["value"] == 1.0


def test_area_is_the_union_of_the_rovers_discs() -> None:
    far = play(team("ll"), [(0.3, 0.3), (0.7, 0.7)])
    same = play([Script(activate(LOW)), Script(NORTH)], [(0.3, 0.3), (0.7, 0.7)])
    assert far["area"] == pytest.approx(2 * LOW_DISC / 10_000)
    assert same["area"] == pytest.approx(LOW_DISC / 10_000)
    assert far["covered"][0].tolist() == [LOW_DISC / 10_000] * 2
    assert same["covered"][0].tolist() == [LOW_DISC / 10_000, 0.0]
    corner = play(team("l"), [(0.0, 0.0)])
    assert corner["area"] == pytest.approx(LOW_DISC / 40_000)


def test_the_fitness_counts_the_area_covered_before() -> None:
    moves = [Script(activate(MED), EAST, activate(LOW)) for _ in range(2)]
    end = play(moves, PAIR, [(*ROCK, "A")], iterations=3)
    assert end["detected"].tolist() == [2]
    for v, (x, y) in enumerate(end["position"][2]):
        seen = sum(
            math.hypot(i / 100 + 0.005 - x, j / 100 + 0.005 - y) < 0.07
            or math.hypot(i / 100 + 0.005 - PAIR[v][0], j / 100 + 0.005 - PAIR[v][1]) < 0.05
            for i in range(100)
            for j in range(100)
        )
        assert end["covered"][2, v] == seen / 10_000
        d2 = (x - ROCK[0]) ** 2 + (y - ROCK[1]) ** 2
        assert end["fitness"][v] == pytest.approx(seen / 10_000 / d2)


def test_value_times_area() -> None:
    rocks = [(*ROCK, "A"), (0.5, 0.51, "E")]
    end = play(team("ll"), PAIR, rocks, fitness="product")
    np.testing.assert_allclose(end["fitness"], [2 * LOW_DISC / 10_000] * 2, rtol=1e-12)


def test_switches_and_counts() -> None:
    acts = [activate(LOW), activate(LOW), NORTH, activate(HI), activate(LOW)]
    end = play([Script(*acts)], [(0.5, 0.5)], iterations=5)
    assert end["action"][:, 0].tolist() == [LOW, LOW, MOVE, HI, LOW]
    assert end["counts"].tolist() == [[3, 0, 1, 1]]
    assert end["switches"].tolist() == [3]


def test_both_move_outputs_are_one_action() -> None:
    end = play([Script([0, 0, 0, 1, 0.5], [0, 0, 0, 0.5, 1])], [(0.5, 0.5)], iterations=4)
    assert end["counts"].tolist() == [[0, 0, 0, 4]]
    assert end["switches"].tolist() == [0]


# --- energy -------------------------------------------------------------------------------------


def test_every_action_has_its_price() -> None:
    acts = [activate(LOW), activate(MED), activate(HI), NORTH]
    end = play([Script(*acts)], [(0.5, 0.5)], iterations=4)
    np.testing.assert_allclose(
        1000 - end["energy"][:, 0], np.cumsum([0.15, 0.25, 0.35, 0.06]), rtol=1e-9
    )


def test_reporting_costs_once_per_iteration() -> None:
    rocks = [(*ROCK, "A"), (0.5, 0.51, "A")]
    end = play(team("llm"), [*PAIR, (0.49, 0.5)], rocks, iterations=2)
    np.testing.assert_allclose(1000 - end["energy"][0], [0.20, 0.20, 0.25])
    np.testing.assert_allclose(1000 - end["energy"][1], [0.35, 0.35, 0.50])


def test_a_rover_out_of_energy_does_nothing_more_but_stays_visible() -> None:
    spent, watcher = Script(activate(HI)), Script(activate(LOW))
    start = [(0.5, 0.5), (0.51, 0.5)]
    end = play([spent, watcher], start, [(*ROCK, "D")], energy=0.4, iterations=5)
    # 0.4 pays 0.35 twice (0.05 is left, and is enough to start) and 0.15 three times.
    assert end["action"][:, 0].tolist() == [HI, HI, NONE, NONE, NONE]
    assert end["action"][:, 1].tolist() == [LOW, LOW, LOW, NONE, NONE]
    assert spent.calls == 2
    assert end["counts"].tolist() == [[0, 0, 2, 0], [3, 0, 0, 0]]
    np.testing.assert_allclose(end["energy"][-1], [-0.3, -0.05], atol=1e-12)
    # The dead one still shows hi, to the west (octant 4) of the watcher.
    assert end["sensors"][2, 1, 4] == pytest.approx(1.0)
    assert not end["sensors"][2:, 0].any()


def test_dead_bodies_are_obstacles() -> None:
    start = [(0.5, 0.5), (0.511, 0.5)]
    end = play([Script(activate(HI)), Script(activate(LOW), WEST)], start, energy=0.2, iterations=2)
    assert end["action"][1].tolist() == [NONE, MOVE]
    np.testing.assert_array_equal(end["position"][1], start)


# --- moving -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outputs", "step"),
    [
        ([0, 0, 0, 1, 1], (0.01 / math.sqrt(2), 0.01 / math.sqrt(2))),
        ([0, 0, 0, 0.9, 0.5], (0.008 / math.sqrt(2), 0)),
        ([0.1, 0, 0, 0.2, 0.1], (-0.006 / math.sqrt(2), -0.008 / math.sqrt(2))),
        (step_towards(1.0), (0.01 * math.cos(1.0), 0.01 * math.sin(1.0))),
    ],
)
def test_a_step(outputs: Sequence[float], step: tuple[float, float]) -> None:
    end = play([Script(outputs)], [(0.5, 0.5)])
    np.testing.assert_allclose(end["position"][0, 0] - 0.5, step, atol=1e-15)
    assert np.hypot(*(end["position"][0, 0] - 0.5)) <= 0.01 + 1e-15


@pytest.mark.parametrize("place", [(0.005, 0.5), (0.995, 0.5), (0.5, 0.995), (0.5, 0.005)])
def test_the_edge_refuses_a_move_which_still_costs_energy(place: tuple[float, float]) -> None:
    outwards = step_towards(math.atan2(place[1] - 0.5, place[0] - 0.5))
    inwards = step_towards(math.atan2(0.5 - place[1], 0.5 - place[0]))
    end = play([Script(outwards, inwards)], [place], iterations=2)
    np.testing.assert_array_equal(end["position"][0, 0], place)
    assert end["energy"][0, 0] == pytest.approx(1000 - 0.06)
    assert end["counts"].tolist() == [[0, 0, 0, 2]]
    assert np.hypot(*(end["position"][1, 0] - place)) == pytest.approx(0.01)


def test_a_canal_refuses_a_move() -> None:
    mask = OPEN.copy()
    mask[100, 104] = True  # x in [0.520, 0.525), y in [0.500, 0.505)
    start = [(0.5122, 0.5025), (0.5122, 0.5075), (0.5275, 0.504), (0.5075, 0.5005)]
    end = play([Script(EAST), Script(EAST), Script(WEST), Script(EAST)], start, mask=mask)
    moved = end["position"][0] - start
    assert moved[0].tolist() == [0.0, 0.0]  # the target lies in the canal
    assert moved[1, 0] == pytest.approx(0.01)  # passes north of it
    assert moved[2, 0] == pytest.approx(-0.01)  # over one cell: why canals are four wide
    assert moved[3, 0] == pytest.approx(0.01)  # stops in front of it


def test_another_rovers_last_place_is_taken_even_if_it_leaves() -> None:
    for gap, moved in ((0.0119, 0.0), (0.0121, 0.01)):
        start = [(0.5, 0.5), (0.5 + gap, 0.5)]
        end = play([Script(EAST), Script(EAST)], start)
        assert end["position"][0, 0, 0] - 0.5 == pytest.approx(moved)
        assert end["position"][0, 1, 0] - start[1][0] == pytest.approx(0.01)


def test_of_two_proposals_for_one_place_the_lower_index_wins() -> None:
    start = [(0.5, 0.5), (0.521, 0.5)]
    end = play([Script(EAST), Script(WEST)], start)
    np.testing.assert_allclose(end["position"][0], [(0.51, 0.5), (0.521, 0.5)])


def test_a_proposal_counts_even_if_it_yields_itself() -> None:
    # 0 and 1 propose places 0.001 apart, 1 and 2 too, 0 and 2 are 0.0021 apart.
    start = [(0.5, 0.5), (0.511, 0.51), (0.5021, 0.5)]
    south = step_towards(-math.pi / 2)
    end = play([Script(EAST), Script(south), Script(EAST)], start)
    np.testing.assert_allclose(end["position"][0], [(0.51, 0.5), start[1], start[2]])
    # Without rover 0, rover 1 gets its place and rover 2 still yields.
    end = play([Script(activate(LOW)), Script(south), Script(EAST)], start)
    np.testing.assert_allclose(end["position"][0], [start[0], (0.511, 0.5), start[2]])
    # A move that is refused for its target alone proposes nothing.
    mask = OPEN.copy()
    mask[100, 102] = True  # y in [0.500, 0.505): contains rover 1's target only
    lifted = [(0.5, 0.4999), (0.511, 0.51), (0.5021, 0.4999)]
    end = play([Script(activate(LOW)), Script(south), Script(EAST)], lifted, mask=mask)
    np.testing.assert_allclose(end["position"][0], [lifted[0], lifted[1], (0.5121, 0.4999)])


# --- sensing ------------------------------------------------------------------------------------


def test_octants_run_counter_clockwise_from_east() -> None:
    compass = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    assert [oracle.octant(dx, dy) for dx, dy in compass] == list(range(8))  # lower edges belong
    for o in range(8):
        angle = math.radians(45 * o + 22.5)
        assert oracle.octant(math.cos(angle), math.sin(angle)) == o
    assert oracle.octant(1.0, -1e-20) == 7


def test_rover_sensors_show_the_closest_rovers_setting() -> None:
    others = [(0.5, 0.515), (0.501, 0.518), (0.485, 0.499), (0.5, 0.479)]
    acts = [MED, HI, MED, HI, LOW]
    end = play([Script(activate(a)) for a in acts], [(0.5, 0.5), *others], iterations=2)
    # d_min^2 / d^2 in octants 1 (just right of north), 2 (north, its lower edge) and 4 (just
    # south of west); the rover in the south is out of range.
    near = np.array([0, 1 / (0.01 + 3.24), 1 / 2.25, 0, 1 / (2.25 + 0.01), 0, 0, 0])
    before = np.array([0, 1, 1, 0, 1, 0, 0, 0])  # all show "low" before the first activation
    after = np.array([0, 2, 3, 0, 3, 0, 0, 0])
    np.testing.assert_allclose(end["sensors"][0, 0, :8], before * near / 3, rtol=1e-9)
    np.testing.assert_allclose(end["sensors"][1, 0, :8], after * near / 3, rtol=1e-9)


def test_a_hidden_rover_does_not_count_and_nearness_saturates() -> None:
    start = [(0.5, 0.5), (0.504, 0.501), (0.51, 0.501)]
    end = play(team("lmh"), start, iterations=2)
    assert end["sensors"][1, 0, 0] == pytest.approx(2 / 3)  # med, at less than d_min
    assert not end["sensors"][1, 0, 1:8].any()


def test_the_shown_setting_survives_a_move() -> None:
    end = play([Script(activate(LOW)), Script(activate(HI), NORTH, NORTH)], PAIR, iterations=3)
    place = end["position"][1, 1] - PAIR[0]
    np.testing.assert_allclose(place, (0.01, 0.01))  # near the edge of octants 0 and 1
    assert end["sensors"][2, 0, :2].sum() == pytest.approx(3 / 3 / 2)


def test_rock_sensors_work_only_after_an_activation_and_in_its_range() -> None:
    acts = [activate(HI), activate(LOW), NORTH, activate(MED)]
    rocks = [(0.5, 0.52, "B"), (0.5, 0.515, "A"), (0.54, 0.501, "C"), (0.499, 0.5, "D")]
    end = play([Script(*acts)], [(0.5, 0.5)], rocks, iterations=4)
    rock = end["sensors"][:, 0, 8:]
    assert not rock[0].any()  # no previous action
    assert not rock[3].any()  # the previous action was a move
    z_north = 2 * 1e-4 / 0.02**2 + 1 * 1e-4 / 0.015**2
    z_east = 3 * 1e-4 / (0.04**2 + 0.001**2)
    near, east = 4 / (1 + 4), z_east / (1 + z_east)  # west at 0.001: bounded by d_min
    north = z_north / (1 + z_north)
    np.testing.assert_allclose(rock[1], [0, 0, north, 0, near, 0, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(rock[2], [east, 0, north, 0, near, 0, 0, 0], rtol=1e-9)


def test_detected_rocks_vanish_from_the_sensors_one_iteration_later() -> None:
    rocks = [(*ROCK, "A"), (0.505, 0.48, "D")]
    late = [1.0, 0.0, 0.0]  # every draw fails at first
    end = play(team("ll"), PAIR, rocks, uniform=lambda t, k, v: late[t], iterations=3)
    assert end["detected"].tolist() == [1, -1]
    rock = end["sensors"][:, 0, 8:]
    assert (rock[1] > 0).sum() == 2
    assert (rock[2] > 0).sum() == 1
    z = 4 * 1e-4 / (0.005**2 + 0.02**2)
    assert rock[2].max() == pytest.approx(z / (1 + z))


# --- thinking -----------------------------------------------------------------------------------


def test_the_highest_output_acts_and_the_first_on_a_tie() -> None:
    assert oracle.choose([0.5] * 5) == LOW
    assert oracle.choose([0.1, 0.5, 0.5, 0.5, 0.5]) == MED
    assert oracle.choose([0.1, 0.2, 0.9, 0.5, 0.9]) == HI
    assert oracle.choose([0.1, 0.2, 0.3, 0.9, 0.5]) == MOVE
    assert oracle.choose([0.1, 0.2, 0.3, 0.4, 0.5]) == MOVE


def test_a_network_by_hand() -> None:
    genes = np.zeros((2, 31), np.float32)
    genes[0, 3] = 0.5  # sensor 3 -> weight 5
    genes[0, 16 + 2] = -1.0  # context 2 -> weight -10
    genes[0, 26 + 1] = 1.0  # -> MO-1, weight 10
    genes[1, 16 + 0] = 1.0  # context 0 -> weight 10
    genes[1, 26 + 4] = -0.5  # -> MO-4, weight -5
    network = oracle.Network(genes, [0, -1, 1])  # slot 1 is empty
    sensors = np.zeros(16)
    sensors[3] = 0.4

    def s(x: float) -> float:
        return 1 / (1 + math.exp(-x))

    h0, h2 = s(2.0), s(0.0)
    np.testing.assert_allclose(network(0, sensors), [0.5, s(10 * h0), 0.5, 0.5, s(-5 * h2)])
    h0, h2 = s(2.0 - 10 * h2), s(10 * h0)
    np.testing.assert_allclose(network(1, sensors), [0.5, s(10 * h0), 0.5, 0.5, s(-5 * h2)])


def test_slots_beyond_the_context_feed_no_context() -> None:
    genes = np.full((1, 31), 0.1, np.float32)
    tall, top = oracle.Network(genes, [-1] * 10 + [0]), oracle.Network(genes, [0])
    sensors = np.linspace(0, 1, 16)
    assert tall(0, sensors) == top(0, sensors)
    assert tall(1, sensors) == tall(2, sensors)  # no memory
    assert top(1, sensors) != tall(1, sensors)


@pytest.mark.parametrize(
    ("kind", "share"),
    [("low", [0.7, 0, 0, 0.3]), ("med", [0, 0.7, 0, 0.3]), ("hi", [0, 0, 0.7, 0.3]),
     ("non-specialized", [0.25] * 4)],
)  # fmt: skip
def test_heuristic_rovers_follow_table_5_3(kind: str, share: list[float]) -> None:
    n = 400
    rover = oracle.Heuristic(oracle.PREFERENCES[kind], lambda t: ((t + 0.5) / n, 0.25))
    outputs = [rover(t, np.zeros(16)) for t in range(n)]
    actions = [oracle.choose(o) for o in outputs]
    assert [actions.count(a) / n for a in range(4)] == share
    assert outputs[-1] == NORTH  # a quarter turn from +x


# --- a short run with everything in it ----------------------------------------------------------


def test_no_rule_is_broken_in_a_random_run() -> None:
    rng = np.random.default_rng(5)
    mask = load(8)
    spots = sites(mask)
    chosen = spots[rng.permutation(len(spots))[:3000]]
    free = np.argwhere(~mask)
    start = free[rng.permutation(len(free))[:20]][:, ::-1] / 200 + 0.0025
    types = rng.integers(0, 5, 3000)
    p = Params(iterations=40, ranges=(0.2, 0.15, 0.1))
    genes = rng.uniform(-1, 1, (60, 31)).astype(np.float32)
    team: list[oracle.Controller] = [
        oracle.Network(genes, rng.integers(-1, 60, 12)) for _ in range(10)
    ]
    pairs = rng.random((40, 20, 2))
    kinds = list(oracle.PREFERENCES.values())
    for v in range(10, 20):
        team.append(oracle.Heuristic(kinds[v % 4], lambda t, v=v: tuple(pairs[t, v])))
    draws = rng.random((40, 3000, 20))
    values = np.array([1, 2, 3, 4, 1])[types]
    end = oracle.run(p, team, *chosen.T, types, values, mask, start, lambda t, k, v: draws[t, k, v])
    place = end["position"]
    assert not mask[(place[..., 1] * 200).astype(int), (place[..., 0] * 200).astype(int)].any()
    steps = np.hypot(*np.moveaxis(np.diff(place, axis=0, prepend=start[None]), -1, 0))
    assert steps.max() <= 0.01 + 1e-12
    assert not steps[end["action"] != MOVE].any()
    gaps = np.hypot(*np.moveaxis(place[:, :, None] - place[:, None, :], -1, 0))
    assert (gaps + np.eye(20)).min() >= 0.002
    assert end["sensors"].min() >= 0.0
    assert end["sensors"].max() <= 1.0
    found = end["detected"] >= 0
    assert found.sum() > 20  # so that the lines below are not vacuous
    assert 2 * values[found].sum() <= end["credited"].sum()
    assert end["value"] == values[found & (end["detected"] < 39)].sum()
    price = np.array([0.1, 0.2, 0.3, 0.01])
    reports = (1000 - end["energy"][-1] - 40 * 0.05 - end["counts"] @ price) / 0.05
    np.testing.assert_allclose(reports, np.round(reports), atol=1e-6)
    assert ((reports > 0.5) == (end["credited"] > 0)).all()
    assert end["covered"][-1].max() <= end["area"] <= end["covered"][-1].sum()
