"""HyperNEAT: NEAT evolves a function of geometry that gives every connection its weight.

Stanley, D'Ambrosio and Gauci 2009, "A hypercube-based encoding for evolving large-scale neural
networks". The neurons of a fixed network, the substrate, have places in a plane. A genotype is a
compositional pattern-producing network (CPPN): nodes with various functions. Given the places of
two neurons it returns the weight of their connection, so regular patterns of weights are simple.

Teams follow D'Ambrosio and Stanley 2008, "Generative encoding for multiagent learning": the robot's
place in the team is a further input of the CPPN, so one genotype gives different robots that vary
a common pattern (``team = "whole"``), or the same robot everywhere (``"clones"``).

The substrate is the simple recurrent network, so teams are analysed, drawn and exported as any
other. Its inputs are rings of sensors around the robot (octants, infrared sensors), any rest of
them a line; hidden neurons are a ring, outputs a line.

Choice: rings are concentric, one for each kind of sensor, the first innermost.
Choice: one output of the CPPN for each layer of connections: inputs to hidden neurons, context to
hidden neurons, hidden neurons to outputs; the article does so for substrates with hidden layers.
Choice: functions of the nodes are a squashed line, a bell, a wave and the absolute value, made of
+ - * / alone, so that a genotype gives the same weights on every machine.
Choice: hidden neurons are those of the start; their number does not change.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from conevo.errors import UsageError
from conevo.evolution.methods.neat import Neat, NeatConfig, NeatState
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Progress,
    Scores,
    Trials,
)
from conevo.parameters import parameters

__all__ = ["HyperNeat", "HyperNeatConfig", "HyperNeatState", "bell", "squash", "wave"]

N_INPUTS, N_OUTPUTS = 5, 3  # of a CPPN: places of two neurons and of the robot; layers
BLOCK = 2**16  # weights of the CPPNs that are computed together, so that they stay in the cache


@parameters("method")
class HyperNeatConfig(NeatConfig):
    """Parameters of HyperNEAT; those of NEAT are for the CPPNs."""

    team: Literal["clones", "whole"] = "whole"
    """"whole": the robot's place in the team is an input of the CPPN, so one genotype gives
    different robots. "clones": all robots are the same."""
    recurrent: Literal[False] = False
    """CPPNs are feed-forward."""
    nodes: Annotated[int, Ge(0), Le(64)] = 20
    """(nodes) hidden nodes of a CPPN at most."""
    ring: Annotated[int, Ge(1), Le(10_000)] = 8
    """(inputs) sensors in a ring around the robot; inputs that do not fill one lie on a line.
    Choice: 8, as octants and infrared sensors."""
    cppn_scale: Annotated[float, Gt(0), Le(1000)] = 3.0
    """weight of gene 1 in a CPPN. Choice: 3."""
    least: Annotated[float, Ge(0), Lt(1)] = 0.2
    """a connection exists if the size of the CPPN's output is larger, from which its weight then
    rises from 0 (article: 0.2)."""


@dataclass(frozen=True)
class HyperNeatState:
    """State of HyperNEAT.

    Attributes:
        progress: the header; its team are substrates.
        cppns: the state of NEAT, whose networks are the CPPNs.
        n_inputs: S, of a robot.
        n_outputs: O, of a robot.
    """

    progress: Progress
    cppns: NeatState
    n_inputs: int
    n_outputs: int

    def problem(self, first: HyperNeatState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        for name in ("n_inputs", "n_outputs"):
            if getattr(self, name) != getattr(first, name):
                return name
        return self.cppns.problem(first.cppns)


@dataclass(frozen=True)
class HyperNeat:
    """Evolution of CPPNs, which give the weights of recurrent networks; see the module."""

    config: HyperNeatConfig = field(default_factory=HyperNeatConfig)
    name: str = "hyperneat"
    title: str = "HyperNEAT"

    @property
    def neat(self) -> Neat:
        """The method that evolves the CPPNs."""
        own = {one.name: getattr(self.config, one.name) for one in fields(NeatConfig)}
        return Neat(NeatConfig(**own | {"team": "clones"}), n_further=1)

    def init(self, layout: Layout, root: int) -> HyperNeatState:
        """Return generation 0 with CPPNs without hidden nodes.

        Raises:
            UsageError: the layout is not that of the controller "srn".
        """
        return self._first(layout, root, self.neat.init(self._of_cppns(layout), root))

    def inherit(self, layout: Layout, root: int, state: HyperNeatState) -> HyperNeatState:
        """Return generation 0 of another task with the CPPNs of a state, whatever its sizes.

        Raises:
            UsageError: the state is not of this method, or has CPPNs of another number or size.
        """
        neat, sizes = self.neat, self._of_cppns(layout)
        if not isinstance(state, HyperNeatState):
            raise UsageError("HyperNEAT can only start from genotypes of HyperNEAT")
        fresh, old = self.init(layout, root), state.cppns.graphs
        if old.genes.shape != fresh.cppns.graphs.genes.shape:
            raise UsageError(
                "these genotypes cannot be handed on: method.genotypes and method.nodes must be "
                "those of the run that they come from"
            )
        marks = state.cppns.next_mark, state.cppns.next_node
        return self._first(layout, root, neat.continued(sizes, root, old, *marks))

    def _first(self, layout: Layout, root: int, cppns: NeatState) -> HyperNeatState:
        """Return generation 0 with some CPPNs."""
        n_context = layout.n_genes - layout.n_inputs - layout.n_outputs
        if layout.n_outputs < 1 or n_context not in (0, layout.n_hidden):
            raise UsageError(f"{self.title} needs the layout of controller 'srn', not {layout}")
        first = Progress.first(layout, root)
        return HyperNeatState(first, cppns, layout.n_inputs, layout.n_outputs)

    def _of_cppns(self, layout: Layout) -> Layout:
        """Return the layout of teams in which each robot has a CPPN."""
        slots = N_OUTPUTS + self.config.nodes
        n_genes = N_INPUTS + 1 + slots + 2
        return Layout(layout.n_robots, N_OUTPUTS, slots, n_genes, N_INPUTS, N_OUTPUTS)

    def ask(self, state: HyperNeatState) -> Trials:
        """Return a team of every genotype, then of the fittest."""
        asked = self.neat.ask(state.cppns)
        nodes = asked.teams[:, 0]
        active = nodes >= 0
        cppns = np.where(active[..., None], asked.genes[nodes], np.float32(0))
        n_robots, n_slots, n_genes = state.progress.fittest_genes.shape
        genes = self._weights(cppns, active, self._points(state))
        n, r, n_hidden, _ = genes.shape
        rows = np.full((n, r, n_slots), -1, dtype=np.int32)
        rows[:, :, :n_hidden] = np.arange(n * r * n_hidden).reshape(n, r, n_hidden)
        return replace(
            asked,
            genes=genes.reshape(-1, n_genes),
            teams=np.repeat(rows, n_robots // r, axis=1),
        )

    def tell(self, state: HyperNeatState, trials: Trials, scores: Scores) -> HyperNeatState:
        """Return the state after these scores."""
        neat = self.neat
        before = state.progress.counted(trials, scores, is_first=trials.purpose == "genotypes")
        cppns = neat.tell(state.cppns, neat.ask(state.cppns), scores)
        if trials.portrait:
            before = before.crowned(trials, scores)
        progress = replace(
            cppns.progress,
            n_hidden=before.n_hidden,
            fittest_genes=before.fittest_genes,
            fittest_active=before.fittest_active,
        )
        return replace(state, progress=progress, cppns=cppns)

    def _points(self, state: HyperNeatState) -> tuple[FloatArray, ...]:
        """Return the inputs of CPPNs for the connections of each layer, [5, R, U, feeds].

        Sources are the inputs, the context or the outputs; targets are the hidden neurons. For the
        outputs it is the other way round. R is 1 for clones.
        """
        n_robots, _, n_genes = state.progress.fittest_genes.shape
        n_hidden, s, o = int(state.progress.n_hidden[0]), state.n_inputs, state.n_outputs
        whole = self.config.team == "whole"
        robots = _line(n_robots) if whole else np.zeros(1)
        hidden = _ring(n_hidden, 1.0)
        groups, rest = divmod(s, self.config.ring)
        rings = [_ring(self.config.ring, (g + 1) / groups) for g in range(groups)]
        inputs = np.concatenate([*rings, np.stack([_line(rest), np.zeros(rest)])], axis=1)
        outputs = np.stack([_line(o), np.zeros(o)])
        layers = []
        for others, is_source in (
            (inputs, True),
            (hidden[:, : n_genes - s - o], True),
            (outputs, False),
        ):
            shape = len(robots), n_hidden, others.shape[1]
            ends = np.empty((N_INPUTS, *shape))
            ends[0:2] = others[:, None, None, :] if is_source else hidden[:, None, :, None]
            ends[2:4] = hidden[:, None, :, None] if is_source else others[:, None, None, :]
            ends[4] = robots[:, None, None]
            layers.append(ends)
        return tuple(layers)

    def _weights(
        self, cppns: FloatArray, active: BoolArray, points: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return the genes [N, R, U, G] of the substrates that CPPNs describe.

        Args:
            cppns: [N, nodes, genes] of their nodes; 0 where there is no connection.
            active: [N, nodes] their slots in use.
            points: of each layer.
        """
        shapes = [at.shape[1:] for at in points]
        flat = tuple(at.reshape(N_INPUTS, -1) for at in points)
        step = max(1, BLOCK // sum(at.shape[1] for at in flat))
        blocks = [slice(k, k + step) for k in range(0, len(cppns), step)]
        scale = self.config.cppn_scale
        found = [respond(cppns[block], active[block], flat, scale) for block in blocks]
        layers = []
        for shape, parts in zip(shapes, zip(*found, strict=True), strict=True):
            output = np.concatenate(parts).reshape(len(cppns), *shape)
            size = (np.abs(output) - self.config.least) / (1 - self.config.least)
            layers.append(np.where(size > 0, np.sign(output) * size, 0.0))
        genes: FloatArray = np.concatenate(layers, axis=3).astype(np.float32)
        return genes


def respond(
    cppns: FloatArray, active: BoolArray, layers: tuple[FloatArray, ...], scale: float
) -> list[FloatArray]:
    """Return the outputs of CPPNs at the points of each layer, [N, P] in (-1, 1).

    All CPPNs take each step together: the first hidden node of each, then the second.

    Args:
        cppns: [N, nodes, genes] of their nodes, the outputs first.
        active: [N, nodes] whether a slot contains a node.
        layers: [5, P] the inputs of each output.
        scale: weight of gene 1.
    """
    points = np.concatenate(layers, axis=1)
    n_inputs, first = len(points), len(points) + 1
    is_hidden = active & (np.arange(active.shape[1]) >= N_OUTPUTS)
    weights = scale * cppns[:, :, : first + active.shape[1]].astype(np.float64)
    weights[:, :, first:] *= is_hidden[:, None]
    order = np.argsort(np.where(is_hidden, cppns[:, :, -1], np.inf), axis=1, kind="stable")
    kinds = ((cppns[:, :, -2] + 1) / 2 * len(FUNCTIONS)).astype(int)
    values: list[FloatArray] = []  # of each step, [N, P]

    def total(rows: IntArray, nodes: IntArray | int, at: slice) -> FloatArray:
        """Return the weighted inputs of one node of each of these CPPNs at some points."""
        own = weights[rows, nodes]
        sums = np.repeat(own[:, n_inputs, None], points[0, at].size, axis=1)
        for j in range(n_inputs):
            some = np.flatnonzero(own[:, j])
            sums[some] += own[some, j, None] * points[j, at]
        for step, value in enumerate(values):
            weight = own[np.arange(len(rows)), first + order[rows, step]]
            some = np.flatnonzero(weight)
            sums[some] += weight[some, None] * value[rows[some], at]
        return sums

    counts = is_hidden.sum(axis=1)
    for step in range(counts.max(initial=0)):
        rows = np.flatnonzero(counts > step)
        sums = total(rows, order[rows, step], slice(None))
        kind = kinds[rows, order[rows, step]].clip(max=len(FUNCTIONS) - 1)
        value = np.zeros((len(cppns), points.shape[1]))
        for k, function in enumerate(FUNCTIONS):
            value[rows[kind == k]] = function(sums[kind == k])
        values.append(value)
    ends = np.cumsum([0, *(layer.shape[1] for layer in layers)])
    parts = [slice(*pair) for pair in pairwise(ends)]
    everyone = np.arange(len(cppns))
    return [squash(total(everyone, k, part)) for k, part in enumerate(parts)]


def squash(x: FloatArray) -> FloatArray:
    """Return a value in (-1, 1) that rises with x, like a sigmoid."""
    y: FloatArray = x / (1 + np.abs(x))
    return y


def bell(x: FloatArray) -> FloatArray:
    """Return 1 at 0 and less on both sides, like a Gaussian."""
    y: FloatArray = 1 / (1 + x * x)
    return y


def wave(x: FloatArray) -> FloatArray:
    """Return a wave of period 2 between -1 and 1, of parabolas, like a sine."""
    t = x - 2 * np.round(x / 2)
    y: FloatArray = 4 * t * (1 - np.abs(t))
    return y


FUNCTIONS: tuple[Callable[[FloatArray], FloatArray], ...] = (squash, bell, wave, np.abs)


def _line(n: int) -> FloatArray:
    """Return n places from -1 to 1 at equal distances; one is in the middle."""
    places: FloatArray = (2 * np.arange(n) - (n - 1)) / max(n - 1, 1)
    return places


def _ring(n: int, radius: float) -> FloatArray:
    """Return n places [2, n] on a circle, in the middles of n equal sectors.

    Choice: the circle is made of four parabolas, within 0.06 of a real one, by + - * / alone.
    """
    turn = (np.arange(n) + 0.5) / n  # of a full one
    return radius * np.stack([wave(2 * turn + 0.5), wave(2 * turn)])
