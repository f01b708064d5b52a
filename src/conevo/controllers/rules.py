"""A learning classifier system of the Pittsburgh kind: a set of rules that is evolved as a whole.

Smith 1980, "A learning system based on genetic adaptive algorithms"; for teams Potter, De Jong and
Grefenstette 1995, "A coevolutionary approach to learning sequential decision rules", where each
robot's rules are a population of CCGA; Nitschke 2009, section 2.2.5. A rule has a condition, a test
for each input, and an action, the outputs. Tests are symbols or intervals::

    ternary      0: input <= cut      1: input > cut      #: any input
    intervals    low < input <= high, or any input

In every iteration one rule acts: among the rules that match, the one with the most tests
("specificity", so that an exception has precedence over a general rule), or the one with the
highest priority, a gene. A genotype is one rule: its tests, its priority, its outputs.

Choice: where no rule matches, rules with the fewest tests that fail count as matching, as in SAMUEL
(Grefenstette, Ramsey and Schultz 1990).
Choice: equal numbers of tests are decided by priority, equal priorities by the rules' slots.
Choice: rules have no strengths, and no credit passes between them: a Pittsburgh system selects
whole sets of rules. Under MESP and CONE, where a slot is a population, it selects rules.
Choice: a ternary test is # if the size of its gene is at most ``dont_care``, else the symbol of the
gene's sign. An interval has a gene for its centre and one for its width. The width is largest where
it ends to be "any input", so that a small change of a gene has a small effect.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
import warp as wp
from annotated_types import Ge, Gt, Le, Lt

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.controllers.slots import n_neurons
from conevo.errors import UsageError
from conevo.kernels.arrays import named_arrays
from conevo.kernels.phases import Phase
from conevo.parameters import WrongValue, parameters

__all__ = ["RuleSet"]

ENDLESS = wp.constant(3.0e38)


@wp.struct
class RuleShape:
    """Sizes and scales of a set of rules as the kernels need them."""

    n_inputs: int
    n_outputs: int
    n_slots: int
    is_ternary: int
    is_specific: int
    dont_care: float
    cut: float
    input_scale: float
    weight_scale: float


@named_arrays
class RuleWeights:
    """Rules of a team's robots: a test passes if low < input <= high. rank: of rules that match."""

    low: Annotated[wp.array[float], "robots", "slots", "inputs"]
    high: Annotated[wp.array[float], "robots", "slots", "inputs"]
    out: Annotated[wp.array[float], "robots", "slots", "outputs"]
    rank: Annotated[wp.array[float], "robots", "slots"]
    filled: Annotated[wp.array[int], "robots", "slots"]


@named_arrays
class RuleMemory:
    """Tests that fail in each rule; and for recordings, 1 for the rule that acts.

    Others have 1/2 if they match, less if they do not, 0 in empty slots.
    """

    failed: Annotated[wp.array[int], "robots", "slots"]
    shown: Annotated[wp.array[float], "robots", "slots"]


@wp.func
def load(
    weights: RuleWeights,
    shape: RuleShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s rules from genotypes; see ``controllers.protocol.Mind``."""
    n_genes = wp.where(shape.is_ternary != 0, shape.n_inputs, 2 * shape.n_inputs)
    for k in range(shape.n_slots):
        slot = i * shape.n_slots + k
        row = rows[n, i, k]
        weights.filled[slot] = int(row >= 0)
        if row >= 0:
            tests = int(0)
            for j in range(shape.n_inputs):
                low = float(-ENDLESS)
                high = float(ENDLESS)
                gene = genes[row, j]
                if shape.is_ternary != 0:
                    if gene > shape.dont_care:
                        low = shape.cut
                        tests += 1
                    if gene < -shape.dont_care:
                        high = shape.cut
                        tests += 1
                else:
                    narrow = 0.5 * (genes[row, shape.n_inputs + j] + 1.0)
                    if narrow > shape.dont_care:
                        half = (1.0 - narrow) / (1.0 - shape.dont_care)
                        low = shape.input_scale * (gene - half)
                        high = shape.input_scale * (gene + half)
                        tests += 1
                weights.low[slot * shape.n_inputs + j] = low
                weights.high[slot * shape.n_inputs + j] = high
            rank = genes[row, n_genes]
            if shape.is_specific != 0:
                rank = float(tests) + 0.25 * rank
            weights.rank[slot] = rank
            for o in range(shape.n_outputs):
                weight = shape.weight_scale * genes[row, n_genes + 1 + o]
                weights.out[slot * shape.n_outputs + o] = weight


@wp.func
def clear(memory: RuleMemory, shape: RuleShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    for k in range(shape.n_slots):
        memory.failed[i * shape.n_slots + k] = 0
        memory.shown[i * shape.n_slots + k] = 0.0


@wp.func
def match(
    weights: RuleWeights,
    memory: RuleMemory,
    shape: RuleShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Count the tests of rule ``q`` of the team that fail."""
    i = q // shape.n_slots
    if heuristic[i] >= 0 or weights.filled[q] == 0:
        return
    failed = int(0)
    at = q * shape.n_inputs
    j = int(0)
    while j < shape.n_inputs:
        x = inputs[i, j]
        failed += wp.where(weights.low[at + j] < x and x <= weights.high[at + j], 0, 1)
        j += 1
    memory.failed[q] = failed
    memory.shown[q] = 0.5 / float(1 + failed)


@wp.func
def follow(
    weights: RuleWeights,
    memory: RuleMemory,
    shape: RuleShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Let one of robot ``q``'s rules act: it gives the outputs, 0 without any rule."""
    if heuristic[q] >= 0:
        return
    acting = int(-1)
    slot = q * shape.n_slots
    last = slot + shape.n_slots
    while slot < last:
        if weights.filled[slot] != 0:
            if acting < 0:
                acting = slot
            elif memory.failed[slot] < memory.failed[acting]:
                acting = slot
            elif memory.failed[slot] == memory.failed[acting]:
                acting = wp.where(weights.rank[slot] > weights.rank[acting], slot, acting)
        slot += 1
    o = int(0)
    while o < shape.n_outputs:
        output = float(0.0)
        if acting >= 0:
            output = weights.out[acting * shape.n_outputs + o]
        outputs[q, o] = output
        o += 1
    if acting >= 0:
        memory.shown[acting] = 1.0


@parameters("controller")
class RuleSet:
    """Settings of a set of rules; see the module.

    Raises:
        UsageError: fewer slots than rules at the start, or a setting that the tests do not use.
    """

    n_rules: Annotated[int, Ge(1), Le(32)] = 10
    """(rules) rules at the start."""
    max_rules: Annotated[int, Ge(1), Le(64)] = 20
    """(rules) rules at most."""
    conditions: Literal["ternary", "intervals"] = "ternary"
    """tests of a rule: "ternary" symbols, or "intervals"."""
    conflict: Literal["specificity", "priority"] = "specificity"
    """of several rules that match, the one that acts: that with the most tests ("specificity"), or
    with the highest "priority"."""
    dont_care: Annotated[float, Ge(0), Lt(1)] = 0.8
    """share of tests of random rules that any input passes (#)."""
    cut: float = 0.0
    """an input above this is 1 for a ternary test. Choice: 0, since most sensors are 0 where there
    is nothing to sense."""
    input_scale: Annotated[float, Gt(0), Le(1_000_000)] = 1.0
    """inputs that intervals can distinguish lie between this number and its negative."""
    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """output of gene 1."""

    name: ClassVar[str] = "rules"
    max_outputs: ClassVar[int] = 64
    n_memory: ClassVar[int] = 1

    def __post_init__(self) -> None:
        """Refuse settings that contradict each other."""
        if self.max_rules < self.n_rules:
            raise UsageError(
                f"controller.max_rules ({self.max_rules}) must not be below n_rules "
                f"({self.n_rules})"
            )
        unused, default = ("input_scale", 1.0) if self.is_ternary else ("cut", 0.0)
        if (given := getattr(self, unused)) != default:
            raise WrongValue(
                unused,
                f"controller.{unused} = {given}",
                f'has no effect with conditions = "{self.conditions}"',
            )

    @property
    def is_ternary(self) -> bool:
        """Whether tests are ternary."""
        return self.conditions == "ternary"

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a controller: rules."""
        tests = n_inputs if self.is_ternary else 2 * n_inputs
        return Genome(self.n_rules, self.max_rules, tests + 1 + n_outputs)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = RuleShape()
        shape.n_inputs, shape.n_outputs, shape.n_slots = n_inputs, n_outputs, self.max_rules
        shape.is_ternary = int(self.is_ternary)
        shape.is_specific = int(self.conflict == "specificity")
        shape.dont_care, shape.cut = self.dont_care, self.cut
        shape.input_scale, shape.weight_scale = self.input_scale, self.weight_scale
        return Mind(
            weights=RuleWeights,
            memory=RuleMemory,
            shape=shape,
            shape_type=RuleShape,
            sizes={"slots": self.max_rules, "inputs": n_inputs, "outputs": n_outputs},
            load=load,
            clear=clear,
            think=(Phase(match, n_neurons, "q"), Phase(follow, takes="q")),
            probe="shown",
        )

    def rules(self, genes: Floats, n_inputs: int) -> tuple[Floats, Floats, Floats]:
        """Return the rules that genotypes describe, as ``load`` does.

        Args:
            genes: [R, U, G] float32.
            n_inputs: S.

        Returns:
            Ends of the tests, low and high, [R, U, S]; ranks of rules that match [R, U].
        """
        f, dont_care = np.float32, np.float32(self.dont_care)
        gene, endless = genes[:, :, :n_inputs], np.float32(ENDLESS)
        if self.is_ternary:
            above, below = gene > dont_care, gene < -dont_care
            low = np.where(above, f(self.cut), -endless)
            high = np.where(below, f(self.cut), endless)
            is_test, at = above | below, n_inputs
        else:
            narrow = f(0.5) * (genes[:, :, n_inputs : 2 * n_inputs] + f(1))
            half = (f(1) - narrow) / (f(1) - dont_care)
            is_test, at = narrow > dont_care, 2 * n_inputs
            low = np.where(is_test, f(self.input_scale) * (gene - half), -endless)
            high = np.where(is_test, f(self.input_scale) * (gene + half), endless)
        rank: Floats = genes[:, :, at]
        if self.conflict == "specificity":
            rank = is_test.sum(axis=2).astype(f) + f(0.25) * rank
        return low, high, rank

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' controllers once; see ``controllers.protocol.Controller``."""
        f = np.float32
        low, high, rank = self.rules(genes, inputs.shape[1])
        seen = inputs[:, None]
        failed = (~((low < seen) & (seen <= high))).sum(axis=2)
        fewest = np.where(active, failed, low.shape[2] + 1).min(axis=1, keepdims=True)
        acting = np.where(active & (failed == fewest), rank, -np.inf).argmax(axis=1)
        robot = np.arange(len(inputs))
        outputs = f(self.weight_scale) * genes[robot, acting, -n_outputs:]
        outputs = np.where(active.any(axis=1, keepdims=True), outputs, f(0))
        shown = f(0.5) / (1 + failed).astype(f)
        shown[robot, acting] = 1
        return outputs, np.where(active, shown, f(0))[:, :, None]
