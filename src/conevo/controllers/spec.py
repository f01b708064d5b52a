"""The shape of a controller: a simple recurrent (Elman) network built from neuron genotypes."""

from __future__ import annotations

from dataclasses import dataclass

from conevo.errors import UsageError

__all__ = ["ControllerSpec"]


@dataclass(frozen=True)
class ControllerSpec:
    """One hidden layer of sigmoid units; inputs are sensors plus previous hidden activations.

    Nitschke 2009, sections 3.1, 4.1, 5.2 and 6.2.7. A genotype is one hidden neuron: its input
    weights (sensors, then context) followed by its output weights. Genes lie in [-1, 1]; a
    connection weight is ``weight_scale`` times its gene.

    Choice: the context keeps the *initial* number of hidden units. Hidden neurons live in numbered
    slots; slot k < n_hidden feeds context input k; an empty slot feeds 0; slots from n_hidden on
    feed no context. So all genotypes of a world have the same length and recombination between
    populations is always defined (the thesis fixes the inputs while the hidden layer changes).

    Raises:
        UsageError: fewer slots than neurons at the start.
    """

    n_sensors: int
    n_hidden: int
    n_outputs: int
    max_hidden: int
    recurrent: bool = True
    bias: bool = False
    weight_scale: float = 10.0  # Nitschke 2009, tables 4.3, 5.5, 6.5: weights in [-10, 10]

    def __post_init__(self) -> None:
        if self.max_hidden < self.n_hidden:
            raise UsageError(
                f"world.max_hidden ({self.max_hidden}) must not be below n_hidden ({self.n_hidden})"
            )

    @property
    def n_context(self) -> int:
        """Number of context inputs: the initial number of hidden units, 0 if feed-forward."""
        return self.n_hidden if self.recurrent else 0

    @property
    def n_inputs(self) -> int:
        """Number of input units: sensors plus context."""
        return self.n_sensors + self.n_context

    @property
    def n_genes(self) -> int:
        """Genes per neuron: its input weights plus its output weights."""
        return self.n_inputs + self.n_outputs
