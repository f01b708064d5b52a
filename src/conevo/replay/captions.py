"""What a playback says in words: whose team this is, what it reached, which robots took part."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from conevo.evolution.methods.registry import title_of
from conevo.numbers import number
from conevo.playback.about import About

__all__ = ["facts", "subtitle", "title"]


def title(about: About) -> str:
    """Return the task without the world's version, as in "rover/complex-5"."""
    name = about["world"]
    return f"{name.rpartition('-v')[0] or name}/{about['environment']}"


def subtitle(about: About) -> str:
    """Return whose team this is, as in "CONE, seed 1, fittest team of generation 12, epoch 0"."""
    if not about["method"]:
        return "a team of no run"
    team = f"fittest team of generation {about['generation']}"
    return f"{_method(about)}, seed {about['seed']}, {team}, epoch {about['epoch']}"


def facts(about: About) -> tuple[tuple[str, str], ...]:
    """Return names and values: the run, what the team reached, what it is like."""
    found = [("task", about["task"])]
    if about["method"]:
        found += [
            ("method", _method(about)),
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
        share = sum(about["favourite_shares"]) / len(liked)  # 0 of whoever has none
        found.append(("favourite settings", f"{_tally(liked)}; mean share {number(share)}"))
    return tuple(found)


def _method(about: About) -> str:
    """Return the method's name as published."""
    return title_of(about["method"])


def _tally(names: Sequence[str]) -> str:
    """Return how many there are of each, most first, equals by name: "7 move, 3 low"."""
    return ", ".join(f"{n} {name}" for name, n in Counter(sorted(names)).most_common())
