"""Controllers, which map a robot's inputs to its outputs and are built from genotypes.

A world gives a robot inputs and reads its outputs; a method breeds genotypes. A controller connects
them. Its settings are the fields of a frozen dataclass. In a kernel it consists of two Warp structs
and three Warp functions. The weights belong to a team and are shared by all its scenarios; the
memory belongs to an epoch.

An output is any real number. A world that needs a share squashes it (``kernels.outputs.sigmoid``);
a world with a choice takes the highest output.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from conevo.kernels.phases import Phase

__all__ = ["Controller", "Genome", "Mind"]

Floats = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Genome:
    """The parts that a controller is built from.

    A genotype is one *part* of a controller: a hidden neuron, or a whole network. Genes lie in
    [-1, 1]; the controller maps them to the range that it needs.

    Attributes:
        n_parts: parts of every controller at the start.
        max_parts: U, numbered slots for parts; the most that a controller can have.
        n_genes: G, genes of one part.
    """

    n_parts: int
    max_parts: int
    n_genes: int


@dataclass(frozen=True)
class Mind:
    """The Warp side of a controller, for given numbers of inputs and outputs.

    Attributes:
        weights: struct type; its arrays name their dimensions (``kernels.arrays``), "robots" first.
            An array without names has this dimension only.
        memory: struct type, likewise.
        shape: an instance of ``shape_type``: the sizes that the functions need.
        shape_type: struct type.
        sizes: of the dimensions other than "robots" and "team" that the arrays name.
        load: ``load(weights, shape, i, genes, rows, n)`` builds robot i's controller from the pool
            of genotypes ``genes`` [K, G] and the rows [N, R, U] of team n, -1 for an empty slot.
        clear: ``clear(memory, shape, i)`` resets robot i's memory.
        think: ``think(weights, memory, shape, inputs, outputs, i)`` fills robot i's outputs [R, O]
            from its inputs [R, S] and its memory, and writes no other robot's data. Or phases over
            items of the team that the lanes of a block share: their functions take
            ``(weights, memory, shape, inputs, outputs, heuristic, q)``, and skip robots whose
            ``heuristic`` is not negative.
        shared: phases that replace ``think`` where a block has many lanes, with the same results
            bit for bit.
        join: ``join(weights, shape, robots)`` completes the weights after all robots are loaded.
        probe: the array [R, U or more] of the memory with the activation of each slot.
    """

    weights: Any
    memory: Any
    shape: Any
    shape_type: Any
    sizes: dict[str, int]
    load: Any
    clear: Any
    think: Any
    probe: str
    shared: tuple[Phase, ...] = ()
    join: Any = None


class Controller(Protocol):
    """The settings of a kind of controller, with its genome, its Warp side and its oracle."""

    name: ClassVar[str]
    max_outputs: ClassVar[int]

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a controller, given a world's inputs S and outputs O."""

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side, for at most ``max_outputs`` outputs (imports Warp)."""

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' controllers once, equal to the kernel bit for bit.

        Args:
            genes: [R, U, G] float32, genotypes of the parts of each robot.
            active: [R, U] whether a slot contains a part.
            memory: [R, U, M] float32; M numbers for each part, zeros at first. The first of them is
                the activation of the part.
            inputs: [R, S] float32.
            n_outputs: O.

        Returns:
            outputs [R, O], and the new memory.
        """

    @property
    def n_memory(self) -> int:
        """M, numbers that one part remembers."""
