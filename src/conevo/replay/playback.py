"""The playback of a trajectory, for the viewer and for films, with its texts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from conevo.evolution.methods.registry import title_of
from conevo.numbers import number
from conevo.playback.about import About
from conevo.playback.check import DAMAGE, checked, refusal
from conevo.playback.schema import Playback
from conevo.worlds.drawing import drawing

if TYPE_CHECKING:
    from conevo.replay.trajectory import Trajectory

__all__ = ["playback_of", "subtitle", "title"]


def playback_of(trajectory: Trajectory) -> Playback:
    """Return the playback of a trajectory.

    Raises:
        UsageError: it lacks arrays that its world needs, or has impossible values.
    """
    about = trajectory.about
    try:
        made = drawing(about, trajectory.channels)
        return checked(
            replace(made, title=title(about), subtitle=subtitle(about), facts=_facts(about))
        )
    except DAMAGE as error:
        raise refusal(error) from error


def title(about: About) -> str:
    """Return the task without the world's version, as in "rover/complex-5"."""
    name = about["world"]
    return f"{name.rpartition('-v')[0] or name}/{about['environment']}"


def subtitle(about: About) -> str:
    """Return the run and the team, as in "CONE, seed 1, fittest team of generation 12, epoch 0"."""
    if not about["method"]:
        return "a team of no run"
    team = f"fittest team of generation {about['generation']}"
    return f"{title_of(about['method'])}, seed {about['seed']}, {team}, epoch {about['epoch']}"


def _facts(about: About) -> tuple[tuple[str, str], ...]:
    """Return names and values of the run, the team's performance, and its robots."""
    found = [("task", about["task"])]
    if about["method"]:
        found += [
            ("method", title_of(about["method"])),
            ("run", about["label"]),
            ("seed", str(about["seed"])),
            ("generation", str(about["generation"])),
            ("epoch", str(about["epoch"])),
        ]
    units = about.get("units", {})
    found += [
        (name.replace("_", " "), f"{number(value)} {units.get(name, '')}".rstrip())
        for name, value in about["performance"].items()
    ]
    found.append(("team fitness (mean)", number(sum(about["fitness"]) / about["n_robots"])))
    by_hand = [name for name in about["heuristic"] if name]
    if by_hand:
        found.append(("heuristic robots", _tally(by_hand)))
    robots = zip(about["neurons"], about["heuristic"], strict=True)
    neurons = [len(slots) for slots, heuristic in robots if not heuristic]
    if neurons:
        low, high = min(neurons), max(neurons)
        found.append(("hidden neurons", str(low) if low == high else f"{low} to {high}"))
    found.append(("castes", _tally(about["labels"])))
    liked = [name for name in about.get("favourites", ()) if name]
    if liked:
        share = sum(about["favourite_shares"]) / len(liked)  # 0 for robots without one
        found.append(("favourite settings", f"{_tally(liked)}; mean share {number(share)}"))
    return tuple(found)


def _tally(names: Sequence[str]) -> str:
    """Return the number of each name, the most frequent first, ties by name: "7 move, 3 low"."""
    return ", ".join(f"{n} {name}" for name, n in Counter(sorted(names)).most_common())
