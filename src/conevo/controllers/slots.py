"""What controllers made of hidden neurons have in common: numbered slots for them."""

from typing import Annotated

from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.parameters import parameters

__all__ = ["Slots"]


@parameters("controller")
class Slots:
    """Numbers of hidden neurons.

    Raises:
        UsageError: fewer slots than neurons at the start.
    """

    n_hidden: Annotated[int, Ge(1), Le(16)] = 10
    """(neurons) hidden neurons at the start, and those that feed back."""
    max_hidden: Annotated[int, Ge(1), Le(32)] = 20
    """(neurons) hidden neurons that it can grow to."""

    def __post_init__(self) -> None:
        if self.max_hidden < self.n_hidden:
            raise UsageError(
                f"controller.max_hidden ({self.max_hidden}) must not be below n_hidden "
                f"({self.n_hidden})"
            )
