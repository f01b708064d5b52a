"""Sets of rules: conditions, conflicts and actions by hand, on the oracle, which the kernel equals.

A ternary rule for two inputs: two symbols, its priority, its outputs.
"""

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.export.networks import network_of

ONE, ZERO, ANY = 1.0, -1.0, 0.0  # genes of symbols


def outputs_of(rules, inputs, empty=(), **settings):
    """Return the outputs [O] of one robot, and its rules' activations [U]."""
    genes = np.array([rules], np.float32)
    active = np.ones(genes.shape[:2], bool)
    active[0, list(empty)] = False
    n_outputs = 2
    mind = controller("rules", weight_scale=1.0, **settings)
    memory = np.zeros((*active.shape, mind.n_memory), np.float32)
    seen = np.array([inputs], np.float32)
    outputs, memory = mind.forward(genes, active, memory, seen, n_outputs)
    return outputs[0].tolist(), memory[0, :, 0].tolist()


RULES = [
    [ANY, ANY, 1.0, 0.5, 0.0],  # the general rule
    [ONE, ANY, 0.0, 0.0, 0.5],  # its exception
    [ONE, ZERO, -1.0, 0.0, -0.5],  # an exception of the exception
]


@pytest.mark.parametrize(
    ("inputs", "acting"), [((0, 0), 0), ((-1, 5), 0), ((0.25, 0.25), 1), ((0.25, 0), 2)]
)
def test_an_exception_has_precedence_over_a_general_rule(inputs, acting):
    outputs, shown = outputs_of(RULES, inputs)
    assert outputs == RULES[acting][3:]
    assert shown.index(1.0) == acting
    assert all(0 < one <= 0.5 for k, one in enumerate(shown) if k != acting)


def test_or_the_rule_of_the_highest_priority_acts():
    outputs, _ = outputs_of(RULES, (1, 0), conflict="priority")
    assert outputs == RULES[0][3:]
    tied = [[*RULES[1][:2], 0.0, 0.25, 0.0], [ANY, ONE, 0.5, 0.0, 0.25], [*RULES[1]]]
    assert outputs_of(tied, (1, 1))[0] == [0.0, 0.25]  # one test each: by priority
    tied[1][2] = 0.0
    assert outputs_of(tied, (1, 1))[0] == [0.25, 0.0]  # then by slot


def test_where_no_rule_matches_the_nearest_does():
    rules = [[ONE, ONE, 1.0, 0.5, 0.0], [ZERO, ONE, -1.0, 0.0, 0.5]]
    outputs, shown = outputs_of(rules, (0, 0))  # two tests fail, one test fails
    assert outputs == [0.0, 0.5]
    assert shown == pytest.approx([0.5 / 3, 1.0])


def test_intervals_end_above_and_narrow_down_to_their_centre():
    """Centre 1/4; a width gene of 1/2 is 3/4 narrow, half way between dont_care = 1/2 and 1."""
    rule = [0.25, 0.0, 0.5, -1.0, 0.0, 0.0, 0.5]
    other = [0.0, 0.0, -1.0, -1.0, 0.0, 0.5, 0.0]  # any inputs
    for x, acting in ((-0.25, 1), (-0.2, 0), (0.25, 0), (0.75, 0), (0.8, 1)):
        for scale in (1.0, 4.0):
            settings = {"conditions": "intervals", "dont_care": 0.5, "input_scale": scale}
            outputs, _ = outputs_of([rule, other], (x * scale, 9), **settings)
            assert outputs == ([0.0, 0.5], [0.5, 0.0])[acting], x


def test_the_share_of_random_tests_that_any_input_passes():
    rng = np.random.default_rng(1)
    for conditions, dont_care in (("ternary", 0.8), ("intervals", 0.8), ("ternary", 0.3)):
        mind = controller("rules", conditions=conditions, dont_care=dont_care)
        genes = rng.uniform(-1, 1, (1, 50, mind.genome(20, 2).n_genes)).astype(np.float32)
        low, high, _ = mind.rules(genes, 20)
        assert ((low < -1e38) & (high > 1e38)).mean() == pytest.approx(dont_care, abs=0.04)


def test_a_robot_without_rules_is_idle_and_empty_slots_never_act():
    assert outputs_of(RULES, (1, 0), empty=[0, 2]) == ([0.0, 0.5], [0.0, 1.0, 0.0])
    assert outputs_of(RULES, (1, 0), empty=[0, 1, 2]) == ([0.0, 0.0], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n_rules": 5, "max_rules": 4}, "max_rules (4) must not be below n_rules (5)"),
        ({"dont_care": 1.0}, "controller.dont_care = 1.0"),
        ({"conditions": "intervals", "cut": 0.5}, "controller.cut = 0.5: has no effect with"),
        ({"input_scale": 2.0}, 'has no effect with conditions = "ternary"'),
        ({"conditions": "binary"}, "controller.conditions = 'binary'"),
    ],
)
def test_wrong_settings_are_refused_in_one_line(settings, words):
    with pytest.raises(UsageError) as caught:
        controller("rules", **settings)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_rules_are_not_exported():
    genes = np.array([RULES], np.float32)
    with pytest.raises(UsageError, match=r"'rules' cannot be exported"):
        network_of(controller("rules"), genes, np.ones((1, 3), bool), 2, 2)
