"""What a controller is: it turns a robot's inputs into its outputs, and is built from genotypes.

A world gives a robot inputs and reads its outputs; a method breeds genotypes. Between them lies a
controller: its settings are the fields of a frozen dataclass, and its life in a kernel is in
two Warp structs and three Warp functions. The weights belong to a team and are shared by all its
scenarios; the memory belongs to an epoch.

An output is any real number. A world that needs a share of something squashes it
(``kernels.outputs.sigmoid``); the highest output is the one that is chosen.
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
    """What a controller is built from.

    A genotype is one *part* of a controller: a hidden neuron, or a whole network. Genes lie in
    [-1, 1]; the controller maps them onto what it needs.

    Attributes:
        n_parts: parts of every controller at the start.
        max_parts: U, numbered slots for parts; the most a controller can grow to.
        n_genes: G, genes of one part.
    """

    n_parts: int
    max_parts: int
    n_genes: int


@dataclass(frozen=True)
class Mind:
    """The Warp side of a controller, for robots with so many inputs and outputs.

    Attributes:
        weights: struct type; its arrays name their dimensions (``kernels.arrays``), "robots" first,
            which is all that an array without names has.
        memory: struct type, likewise.
        shape: an instance of ``shape_type``: the sizes that the functions need.
        shape_type: struct type.
        sizes: of the dimensions other than "robots" and "team" that the arrays name.
        load: ``load(weights, shape, i, genes, rows, n)`` builds robot i's controller from the pool
            of genotypes ``genes`` [K, G] and the rows [N, R, U] of team n, -1 for an empty slot.
        clear: ``clear(memory, shape, i)`` lets robot i remember nothing.
        think: ``think(weights, memory, shape, inputs, outputs, i)`` fills robot i's outputs [R, O]
            from its inputs [R, S] and its memory, and writes nothing of another robot. Or phases
            over items of the team that the lanes of a block share: their functions take
            ``(weights, memory, shape, inputs, outputs, heuristic, q)``, and leave robots alone
            whose ``heuristic`` is not negative.
        shared: phases that give the bits of ``think`` where a block has many lanes.
        join: ``join(weights, shape, robots)`` does what remains when all robots are loaded.
        probe: the array [R, U or more] of the memory that shows the activation of each slot.
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
    """The settings of a kind of controller, and what follows from them."""

    name: ClassVar[str]
    max_outputs: ClassVar[int]

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return what one is built from, given a world's inputs S and outputs O."""

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side, for at most ``max_outputs`` outputs (imports Warp)."""

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' controllers once, with the kernel's own arithmetic: the same bits.

        Args:
            genes: [R, U, G] float32, genotypes of the parts of each robot.
            active: [R, U] slots that hold a part.
            memory: [R, U, M] float32; M numbers for each part, zeros at first. The first of them is
                the activation of the part.
            inputs: [R, S] float32.
            n_outputs: O.

        Returns:
            outputs [R, O], and the memory after this.
        """

    @property
    def n_memory(self) -> int:
        """M, numbers that one part remembers."""
