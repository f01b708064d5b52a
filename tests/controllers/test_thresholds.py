"""Response thresholds: the papers' steps by hand, on the oracle, which the kernel equals."""

from dataclasses import asdict

import numpy as np
import pytest

from conevo.controllers.registry import CONTROLLERS, controller
from conevo.errors import UsageError
from conevo.export.networks import network_of


def tasks(*those):
    """Return one robot's genotypes [1, U, G] and its slots in use, none of them empty."""
    genes = np.array([those], np.float32)
    return genes, np.ones(genes.shape[:2], bool)


def play(mind, genes, active, inputs):
    """Return outputs and memory after each of the inputs [T, R, S]."""
    memory = np.zeros((*active.shape, mind.n_memory), np.float32)
    seen = []
    for now in np.array(inputs, np.float32):
        outputs, memory = mind.forward(genes, active, memory, now, active.shape[1])
        seen.append((outputs, memory))
    return seen


@pytest.mark.parametrize(("steepness", "response"), [(1, 2 / 3), (2, 4 / 5), (3, 8 / 9)])
def test_the_response_is_that_of_the_paper(steepness, response):
    """Stimulus sigmoid(0) = 1/2 and threshold 1/4: s^n / (s^n + theta^n) = 2^n / (2^n + 1)."""
    mind = controller("thresholds", theta=0.25, steepness=steepness, gain=3.0)
    ((outputs, memory),) = play(mind, *tasks([0, 0], [1, -1]), [[[1.0]]])
    assert memory[0, 0, 0] == pytest.approx(response)
    assert outputs[0, 0] == pytest.approx(3 * (2 * response - 1))
    assert outputs[0, 1] == outputs[0, 0]  # 10 * 1 - 10 is the stimulus of the other task, too


def test_a_threshold_is_a_gene_unless_it_is_given():
    """Stimulus and threshold are equal at the gene that maps to 1/2, and the response is 1/2."""
    half = (0.5 - 1 / 64) / (1 - 1 / 64) * 2 - 1
    mind = controller("thresholds")
    assert mind.genome(1, 3).n_genes == 3
    assert controller("thresholds", theta=0.5).genome(1, 3).n_genes == 2
    ((outputs, memory),) = play(mind, *tasks([0, 0, half], [0, 0, -1], [0, 0, 1]), [[[0.0]]])
    assert memory[0, 0, 0] == pytest.approx(1 / 2)
    assert outputs[0, 1] > outputs[0, 0] > outputs[0, 2]  # the lower the threshold, the stronger


def test_thresholds_are_reinforced_within_their_bounds():
    """The task that is done falls by xi, the other one rises by phi, and both stop at the end."""
    mind = controller("thresholds", theta=0.5, xi=0.125, phi=0.0625)
    seen = play(mind, *tasks([0, 0.1], [0, 0]), np.zeros((12, 1, 1)))
    thresholds = np.array([0.5 + memory[0, :, 1] for _, memory in seen])
    assert thresholds[:3].tolist() == [[0.375, 0.5625], [0.25, 0.625], [0.125, 0.6875]]
    assert thresholds[-1].tolist() == [1 / 64, 1]
    assert seen[-1][0][0, 0] > seen[0][0][0, 0]  # the easier, the stronger the response


def test_clones_with_other_experiences_become_specialists():
    """Theraulaz et al. 1998: equal individuals, each of which keeps to the task it did first."""
    genes, active = tasks([1, 0], [-1, 0])
    genes, active = genes.repeat(2, axis=0), active.repeat(2, axis=0)
    first = [[[0.1], [-0.1]]] * 3
    nothing = [[[0.0], [0.0]]] * 5
    for xi, tasks_done in ((0.05, [0, 1]), (0.0, [0, 0])):
        mind = controller("thresholds", theta=0.5, xi=xi, phi=xi)
        outputs, _ = play(mind, genes, active, first + nothing)[-1]
        assert outputs.argmax(axis=1).tolist() == tasks_done


def test_a_stimulus_may_be_one_input():
    genes, active = tasks([0.5, -0.75, 0.25, 0, 0])
    inputs = [[[3.0, 0.125, 7.0]]]
    for stimulus, drive in (("sum", 15 - 0.9375 + 17.5), ("input", -0.9375)):
        mind = controller("thresholds", stimulus=stimulus, theta=0.0)
        ((_, memory),) = play(mind, genes, active, inputs)
        share, theta = 1 / (1 + np.exp(-drive)), 1 / 64 + 0.5 * 63 / 64
        assert memory[0, 0, 0] == pytest.approx(share**2 / (share**2 + theta**2), rel=1e-5)


def test_a_lost_task_has_no_response_and_a_robot_without_tasks_is_idle():
    genes, active = tasks([0, 0, 0], [0, 0, 0])
    active[0, 1] = False
    ((outputs, memory),) = play(controller("thresholds"), genes, active, [[[1.0]]])
    assert outputs[0, 1] == -5
    assert not memory[0, 1].any()
    ((outputs, _),) = play(controller("thresholds"), genes, active & False, [[[1.0]]])
    assert not outputs.any()


def test_thresholds_that_change_are_not_exported_and_a_threshold_below_all_genes_is_refused():
    genes, active = tasks([0, 0, 0])
    network_of(controller("thresholds"), genes, active, 1, 1)
    with pytest.raises(UsageError, match=r"xi = 0\.1 .*cannot be exported"):
        network_of(controller("thresholds", xi=0.1), genes, active, 1, 1)
    with pytest.raises(UsageError, match=r"controller.theta = 0\.01: must be 0, or from 1/64 to 1"):
        controller("thresholds", theta=0.01)


@pytest.mark.parametrize(
    ("name", "settings", "remembers"),
    [
        ("srn", {}, True),
        ("srn", {"recurrent": False}, False),
        ("gru", {}, True),
        ("thresholds", {}, False),
        ("thresholds", {"phi": 0.1}, True),
        ("rules", {}, False),
    ],
)
def test_the_registry_knows_which_robots_remember(name, settings, remembers):
    """As reports state it: outputs for the same inputs differ, or do not, after other inputs."""
    mind, rng = controller(name, **settings), np.random.default_rng(2)
    assert CONTROLLERS[name].remembers(asdict(mind)) == remembers
    genome = mind.genome(3, 2)
    genes = rng.uniform(-1, 1, (4, genome.max_parts, genome.n_genes)).astype(np.float32)
    active = np.ones(genes.shape[:2], bool)
    memory = np.zeros((*active.shape, mind.n_memory), np.float32)
    inputs = rng.uniform(-1, 1, (4, 3)).astype(np.float32)
    first, memory = mind.forward(genes, active, memory, inputs, 2)
    _, memory = mind.forward(genes, active, memory, -inputs, 2)
    again, _ = mind.forward(genes, active, memory, inputs, 2)
    assert (first.tobytes() != again.tobytes()) == remembers
