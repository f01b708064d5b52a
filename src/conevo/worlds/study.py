"""Studies: the observed behaviours of a world's robots, beyond their actions.

The entry of a world names a module with the members of ``WorldStudy``; ``registry.study_of`` finds
it. It identifies behaviours in recorded epochs. From these, ``studies.observation`` computes S,
castes, lesions, clones and tables for any world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

from conevo.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from conevo.worlds.protocol import Scenarios, Simulator

__all__ = ["Account", "AccountPart", "Composed", "Seen", "StudyWords", "WorldStudy", "load_study"]

NEEDED = ("BEHAVIOURS", "COLLECTIVES", "WORDS", "observe", "account")


@dataclass(frozen=True)
class StudyWords:
    """The words of a study in reports and messages.

    Attributes:
        robots: the word for the robots.
        events: the word for the events in which collective behaviours are counted.
        done: the verb for a team in an event, where "so" means in one of these behaviours.
        undone: the words for a team without an event.
    """

    robots: str = "robots"
    events: str = "occurrences"
    done: str = "behaves so"
    undone: str = "did nothing together"


class AccountPart(NamedTuple):
    """A line of an account, with the table below it, if any; numbers in it are not formatted."""

    line: str
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str | float]] = ()


class Account(NamedTuple):
    """Findings to be printed: measures of the team by their names, then the rest."""

    measures: Mapping[str, float]
    parts: Sequence[AccountPart]


class Composed(NamedTuple):
    """A team composed of robots of several behaviours.

    Attributes:
        name: of the collective behaviour.
        roles: behaviour of each of its robots.
        scenarios: for the team.
    """

    name: str
    roles: Sequence[str]
    scenarios: Scenarios


class Seen(Protocol):
    """Observed behaviour of a team in some recorded epochs."""

    @property
    def executed(self) -> Sequence[npt.NDArray[np.int64]]:
        """Behaviour of each robot in each window: its index, -1 for none of them."""

    @property
    def collectives(self) -> tuple[str, dict[str, int]]:
        """The most frequent collective behaviour, and how often each of them was observed."""

    def together(self, keys: Sequence[int]) -> Scenarios:
        """Return the scenarios that clones play, one per key."""

    def compositions(self, keys: Sequence[int]) -> Sequence[Composed]:
        """Return the teams that can be composed of the robots, if any, in scenarios of the keys."""

    def composition(self, labels: Sequence[str]) -> dict[str, int | None]:
        """Return the number of robots that belong to each collective behaviour, and to none.

        Args:
            labels: of each robot, a behaviour or "non-specialized".
        """

    def details(self, lifetimes: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Return all further observations, as plain data.

        Args:
            lifetimes: of each robot, ``studies.lifetimes.Lifetime`` as plain data.
        """


class WorldStudy(Protocol):
    """The members of a study's module."""

    BEHAVIOURS: tuple[str, ...]
    """Behaviours of a robot, which are the castes of the study, in the order of their lists."""
    COLLECTIVES: tuple[str, ...]
    """Collective behaviours; the last one is "none" of these."""
    WORDS: StudyWords

    def observe(
        self,
        simulator: Simulator,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        keys: Sequence[int],
        seed: int,
        rules: Any = None,
    ) -> Seen:
        """Record a team and return its observed behaviour.

        Args:
            simulator: of the team's world.
            genes: pool of genotypes [K, G].
            team: [R, U] rows of the pool.
            keys: of the scenarios.
            seed: of further random numbers.
            rules: that identify behaviours, those of the study by default.
        """

    def account(self, found: Mapping[str, Any]) -> Account:
        """Return the contents of ``Seen.details``, to be printed."""


def load_study(world: str, module: str) -> WorldStudy:
    """Return the module of a world's study.

    Raises:
        UsageError: it cannot be imported, or lacks something.
    """
    try:
        found = import_module(module)
    except (ImportError, TypeError, ValueError) as error:
        raise UsageError(f"world {world}: its study {module!r} is not there: {error}") from error
    if missing := [name for name in NEEDED if not hasattr(found, name)]:
        raise UsageError(f"world {world}: its study {module!r} has no {', no '.join(missing)}")
    return cast("WorldStudy", found)
