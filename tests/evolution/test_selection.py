"""Elite selection: which populations may recombine, worked out by hand."""

import numpy as np
import pytest

from conevo.evolution.selection import (
    elite_distance,
    entropy_distance,
    label_distance,
    pair_populations,
    pair_similar,
    pair_slots,
    shares_distance,
    specialization_distance,
)
from conevo.specialization import shares
from conevo.specialization.diversity import differences
from conevo.specialization.entropy import activity_entropy


def test_specialization_distance_of_the_thesis_controllers():
    # A perfect specialist (S = 0) and a non-specialist (S = 0.5), eqs 3.4 and 3.5.
    distance = specialization_distance(np.array([0.0, 0.5, 0.125]))
    assert distance.tolist() == [[0, 0.5, 0.125], [0.5, 0, 0.375], [0.125, 0.375, 0]]


def test_populations_pair_from_the_most_similar_on():
    # SD: (0,1) 1/64, (2,3) 3/64, (1,2) and the others far.
    s = np.array([0.125, 0.140625, 0.5, 0.453125])
    assert pair_populations(specialization_distance(s), 0.1).tolist() == [[0, 1], [2, 3]]
    assert pair_populations(specialization_distance(s), 0.03).tolist() == [[0, 1]]
    assert pair_populations(specialization_distance(s[::-1]), 0.1).tolist() == [[2, 3], [0, 1]]


def test_a_population_is_taken_once_and_the_rest_stays_alone():
    # SD: (1,2) 1/16 first; then (0,1) 1/8 and (0,2) 3/16 are similar too, but 1 and 2 are taken.
    s = np.array([0.0, 0.125, 0.1875])
    assert pair_populations(specialization_distance(s), 0.25).tolist() == [[1, 2]]


def test_all_pairs_below_the_threshold_come_from_the_most_similar_on():
    distance = specialization_distance(np.array([0.0, 0.125, 0.1875]))
    assert pair_populations(distance, 0.25, "all").tolist() == [[1, 2], [0, 1], [0, 2]]
    assert pair_populations(distance, 0.1875, "all").tolist() == [[1, 2], [0, 1]]
    assert pair_populations(distance, 0.0625, "all").tolist() == []
    distance[0] = distance[:, 0] = np.nan
    assert pair_populations(distance, 1.0, "all").tolist() == [[1, 2]]


def test_distance_of_lives_is_the_share_that_would_have_to_be_spent_differently():
    # Both actions alike; one more of the second; nothing at all; half of the epochs nothing.
    lives = np.array([[0.5, 0.5], [0.25, 0.75], [0.0, 0.0], [0.5, 0.0]])
    assert shares_distance(lives).tolist() == [
        [0, 0.25, 1, 0.5],
        [0.25, 0, 1, 0.75],
        [1, 1, 0, 0.5],
        [0.5, 0.75, 0.5, 0],
    ]
    # Two perfect specialists in different actions: similar by eq. 3.5, not by their actions.
    assert specialization_distance(np.zeros(2))[0, 1] == 0
    assert shares_distance(np.eye(2))[0, 1] == 1


def test_distance_of_lives_agrees_with_the_measure_of_a_teams_diversity():
    counts = np.random.default_rng(1).integers(0, 9, (6, 4))
    counts[2] = 0
    np.testing.assert_allclose(shares_distance(shares(counts)), differences(counts), atol=1e-15)


def test_distance_by_entropy_compares_degrees_of_specialization_without_labels():
    # One action each, two alike, one three times as often as the other, nothing.
    lives = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.25, 0.75], [0.0, 0.0]])
    expected = np.array([0, 0, 1, 2 - 0.75 * np.log2(3), 0])  # bits of two
    found = entropy_distance(lives)
    np.testing.assert_allclose(found, np.abs(expected[:, None] - expected))
    counts = np.random.default_rng(1).integers(0, 9, (6, 4))
    degrees = [activity_entropy(row[None]) / 2 for row in counts]
    np.testing.assert_allclose(
        entropy_distance(shares(counts)), np.abs(np.subtract.outer(degrees, degrees)), atol=1e-12
    )


def test_labels_are_the_action_done_most_and_whether_a_robot_is_specialized():
    does = np.array([[0.6, 0.4], [0.9, 0.1], [0.5, 0.5], [0.4, 0.6], [0.0, 0.0], [0.6, 0.4]])
    s = np.array([0.25, 0.0, 0.5, 0.25, 0.0, np.nan])
    # 0 and 1: the first action, specialized. 2: ties go to the first, S = 0.5 is not specialized.
    # 3: the second action. 4: nothing. 5: S is not known.
    alike = {(0, 1)} | {(k, k) for k in range(5)}
    for i, row in enumerate(label_distance(s, does)):
        for j, distance in enumerate(row):
            assert distance == (0 if (min(i, j), max(i, j)) in alike else 1), (i, j)


def test_similar_means_below_the_threshold_and_known():
    assert pair_populations(specialization_distance(np.array([0.0, 0.25])), 0.25).tolist() == []
    assert pair_populations(specialization_distance(np.array([0.5, 0.5])), 0.0).tolist() == []
    assert pair_populations(
        specialization_distance(np.array([np.nan, 0.5, 0.5])), 1.0
    ).tolist() == [[1, 2]]
    assert (
        pair_populations(specialization_distance(np.array([0.5, 0.5])), float("nan")).tolist() == []
    )


def test_elite_distance_pairs_ranks():
    # One sub-population each, L = 2, G = 2. Rank 1: |diffs| 1, 0 -> GD 0.25; rank 2: 2, 1 -> 0.75.
    a = np.array([[[0.0, 0.5], [1.0, 0.0]]])
    b = np.array([[[1.0, 0.5], [-1.0, 1.0]]])
    assert elite_distance(a, b).tolist() == [[0.5]]
    assert elite_distance(a, b, "sum").tolist() == [[1.0]]
    swapped = b[:, ::-1]  # ranks decide: 1, 0.5 -> 0.375; 0, 0.5 -> 0.125
    assert elite_distance(a, swapped).tolist() == [[0.25]]


def elites_of(values):
    """Return elites [P, U, 2, 3] whose every gene in sub-population (p, u) is values[p][u]."""
    return np.broadcast_to(np.array(values)[:, :, None, None], (*np.shape(values), 2, 3))


def test_sub_populations_pair_greedily_by_genotype_distance():
    # GD = |difference| / 2. Population 0: 0.0, 0.5; population 1: 0.125, 0.25.
    # (0,0)-(1,0) 0.0625 first; then (0,1)-(1,1) 0.125; (0,0)-(1,1) also 0.125 but taken.
    elites = elites_of([[0.0, 0.5], [0.125, 0.25]])
    active = np.ones((2, 2), dtype=bool)
    candidates = np.array([[0, 1]])
    assert pair_similar(elites, active, candidates, 0.2).tolist() == [[0, 2], [1, 3]]
    assert pair_similar(elites, active, candidates, 0.1).tolist() == [[0, 2]]
    assert pair_similar(elites, active, candidates, 0.0625).tolist() == []
    assert pair_similar(elites, active, candidates, 0.2, "sum").tolist() == [[0, 2]]
    assert pair_similar(elites, active, np.empty((0, 2), dtype=int), 1.0).tolist() == []


def test_empty_slots_never_pair():
    elites = elites_of([[0.0, 0.5, 0.0], [0.0, 0.5, 0.0]])
    active = np.array([[True, True, False], [False, True, False]])
    # Left: (0,1)-(1,1) at 0, units 1 and 4; (0,0) has no partner.
    assert pair_similar(elites, active, np.array([[0, 1]]), 1.0).tolist() == [[1, 4]]


def test_sub_populations_of_the_same_slot_only():
    # Crosswise they are the same, slot by slot GD is 0.25.
    elites = elites_of([[0.0, 0.5], [0.5, 0.0]])
    active = np.ones((2, 2), dtype=bool)
    pair = np.array([[0, 1]])
    assert pair_similar(elites, active, pair, 0.3).tolist() == [[0, 3], [1, 2]]
    assert pair_similar(elites, active, pair, 0.3, slots="same").tolist() == [[0, 2], [1, 3]]
    assert pair_similar(elites, active, pair, 0.25, slots="same").tolist() == []
    active[0, 0] = active[1, 1] = False  # slot 1 of the one, slot 0 of the other
    assert pair_similar(elites, active, pair, 0.3).tolist() == [[1, 2]]
    assert pair_similar(elites, active, pair, 0.3, slots="same").tolist() == []


def test_without_population_pairs_the_most_similar_of_all_come_first():
    # CONE-2: (0)-(2) 0.03125 before (0)-(1) 0.0625; then (1) is left without a partner.
    elites = elites_of([[0.0], [0.125], [-0.0625]])
    candidates = np.array([[0, 1], [0, 2], [1, 2]])
    paired = pair_similar(elites, np.ones((3, 1), dtype=bool), candidates, 1.0)
    assert paired.tolist() == [[0, 2]]


@pytest.mark.parametrize("candidates", [np.array([[0, 2]]), np.empty((0, 2), dtype=int)])
def test_slots_pair_where_both_are_used(candidates):
    active = np.array([[True, True, False], [True, True, True], [False, True, True]])
    expected = [[1, 7]] if len(candidates) else []
    assert pair_slots(active, candidates).tolist() == expected


def test_a_population_in_several_pairs_gives_each_slot_to_the_first():
    # Unit p * 3 + u. 1 and 2 have slots 1 and 2 in common, 0 and 1 slots 0 and 1: 1 is taken.
    active = np.array([[True, True, False], [True, True, True], [False, True, True]])
    candidates = np.array([[1, 2], [0, 1], [0, 2]])
    assert pair_slots(active, candidates).tolist() == [[4, 7], [5, 8], [0, 3]]
