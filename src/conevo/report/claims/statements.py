"""The elements of a claim: samples of runs, comparisons of two, shares of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Claim", "Compare", "Part", "Sample", "Statement", "Within"]


Expected = Literal["above", "alike"]
WORLDS = {"R": "rover", "P": "pursuit", "G": "gacc"}


@dataclass(frozen=True)
class Sample:
    """Runs: one value each.

    Attributes:
        quantity: a name in ``quantities.QUANTITIES``.
        methods: the runs of these are pooled.
        environments: and of these.
    """

    quantity: str
    methods: tuple[str, ...]
    environments: tuple[str, ...]


@dataclass(frozen=True)
class Compare:
    """One sample is above another, or alike.

    Environments of the two correspond: either they are the same, or the runs of one environment
    are compared with those of another.
    """

    expect: Expected
    a: Sample
    b: Sample

    @property
    def samples(self) -> tuple[Sample, ...]:
        """Both samples."""
        return (self.a, self.b)

    @property
    def environments(self) -> tuple[str, ...]:
        """All that it is about, each once."""
        return tuple(dict.fromkeys((*self.a.environments, *self.b.environments)))


@dataclass(frozen=True)
class Within:
    """The share of runs in which something was seen, or the mean of runs, is in [low, high]."""

    sample: Sample
    low: float
    high: float

    @property
    def samples(self) -> tuple[Sample, ...]:
        """The only sample."""
        return (self.sample,)

    @property
    def environments(self) -> tuple[str, ...]:
        """All that it is about."""
        return self.sample.environments


Statement = Compare | Within


@dataclass(frozen=True)
class Part:
    """Statements that belong together.

    Attributes:
        statements: of one or more environments.
        need: in how many environments (or groups of environments that a statement pools) all must
            hold; None is in every one.
    """

    statements: tuple[Statement, ...]
    need: int | None = None


@dataclass(frozen=True)
class Claim:
    """One claim of the thesis; it is reproduced if all its parts are.

    Attributes:
        id: letter of the world (R, P, G) and number, or a number of several worlds and the letter.
        text: what is claimed.
        source: section of the thesis.
        parts: what has to hold.
        contradiction: where the thesis states the opposite; such a claim is not judged.
        decided: a cause of the result other than the methods; the verdict is then its own kind.
        caution: limits of a verdict.
        other_world: in which it is tested, without its version, if not in that of its letter.
    """

    id: str
    text: str
    source: str
    parts: tuple[Part, ...]
    contradiction: str = ""
    decided: str = ""
    caution: str = ""
    other_world: str = ""

    @property
    def world(self) -> str:
        """The world in which it is tested, without its version."""
        return self.other_world or next(WORLDS[letter] for letter in self.id if letter in WORLDS)
