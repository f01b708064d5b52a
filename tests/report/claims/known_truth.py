"""Campaigns with known truth: the thesis' claims, and the same with single facts reversed.

They contain no chance: a cell's runs are the quantiles of a normal distribution around its mean.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import NormalDist
from typing import Any

import duckdb

from conevo.campaigns.schema import SCHEMA

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")
VARIANTS = ("cone-1", "cone-2", "cone-3")
EXCHANGING = ("cone", "cone-1", "cone-2")
MEASURES = {
    "rover-v2": ("value", "area"),
    "pursuit-v2": ("capture_time",),
    "gacc-v2": ("delivered",),
    "prey-v2": ("path",),
}
CASTES = {
    "rover-v2": ("low", "hi", "non-specialized"),
    "pursuit-v2": ("pursuer", "blocker", "non-specialized"),
    "gacc-v2": ("A-detector", "B-gatherer", "non-specialized"),
    "prey-v2": ("move-1",),
}


@dataclass
class Cell:
    """The truth about the runs of one method in one environment.

    Attributes:
        value: mean of the world's main measure.
        area: mean of the rovers' second one.
        loss: share of its performance that a team loses by a lesion.
        composed: performance of composed teams, as a share of the team's.
        clones: performance of a team of clones of a specialist, as a share of the team's.
        mixed: that of the clones of a non-specialized robot.
        castes: of the team, one robot each; None: two specialized ones and the non-specialized.
        several: share of the runs with all of these; the others have only the first.
        seen: collective behaviour -> share of the runs that show it.
        idle: share of the runs with an idle predator.
        members: collective behaviours with specialized predators; others are non-specialized.
        hidden: hidden neurons of the champion.
        evaluations: team evaluations of every run.
        stage: of a shaping.
        gst: mean threshold of the distance of genotypes.
        exchanges, exchange_share: pairs that recombine between populations in a generation, and
            their share of those that could.
    """

    value: float
    area: float = 0.4
    loss: float = 0.2
    composed: float = 0.9
    clones: float = 0.5
    mixed: float = 0.4
    castes: tuple[str, ...] | None = None
    several: float = 1.0
    seen: dict[str, float] = field(default_factory=dict)
    idle: float = 0.0
    members: tuple[str, ...] = ()
    hidden: float = 10.0
    evaluations: int = 50_000
    stage: int = 0
    gst: float = 0.2
    exchanges: float = 5.0
    exchange_share: float = 0.05


Truth = dict[tuple[str, str], Cell]  # (environment, method)


def shared(method: str) -> float:
    """Return the share of the pairs that exchange: more without one of the metrics."""
    return 0.2 if method in ("cone-1", "cone-2") else 0.05


def of_rovers(method: str, n: int) -> tuple[str, ...]:
    """Return the castes in complex environment n (tables 5.7 to 5.15)."""
    if method in ("homcne", "hetcne"):
        return ("med", "hi") if method == "homcne" and n <= 6 else ("hi", "med")
    low = {"ccga": 4, "mesp": 3}.get(method, 10)
    med = {"ccga": 8}.get(method, 10)
    some = ("low",) * (n <= low) + ("med",) * (n <= med)
    return (*some, "hi", "non-specialized")


def rover() -> Truth:
    """Return the thesis' claims about rovers."""
    complex_value = dict(zip(METHODS, (1500, 1500, 2500, 2500, 3500), strict=True))
    complex_value |= dict.fromkeys(VARIANTS, 2500)
    loss = dict(zip(METHODS, (0.1, 0.1, 0.3, 0.3, 0.5), strict=True))
    truth: Truth = {}
    for n in range(1, 11):
        best = 1.2 if n == 10 else 1.0
        for method, value in complex_value.items():
            is_cne = method in ("homcne", "hetcne")
            # Clones of CONE's robots are as good as HomCNE and HetCNE.
            about: dict[str, Any] = {
                "loss": loss.get(method, 0.3),
                "several": 0.0 if is_cne else 1.0,
                "clones": 1500 / 3500,
                "mixed": 1500 / 3500,
            }
            covered = best * (0.3 if method in VARIANTS else 0.4)
            more = {"castes": of_rovers(method, n), "exchange_share": shared(method)}
            truth[f"complex-{n}", method] = Cell(best * value, covered, **about, **more)
            if method in METHODS:
                covered = 0.3 if is_cne else 0.4
                truth[f"extended-{n}", method] = Cell(value, covered, **about)
                truth[f"simple-{n}", method] = Cell(1200, **about | {"several": 0.0})
    return truth


# Share of the runs that show a behaviour, by team type: most where it works best (4.5.1 to 4.5.4).
ENTRAPMENT = (0.4, 1, 1, 0.4, 0.4, *[0.95] * 4, 1)
SEEN: dict[str, dict[str, tuple[float, ...]]] = {
    "homcne": {"entrapment": ENTRAPMENT},
    "hetcne": {"entrapment": ENTRAPMENT},
    "ccga": {
        "pursuer-blocker": (0, 1, 1, 0.3, 0.3, *[0.8] * 4, 0.7),
        "spiders-fly": (1, 1, 1, 0, 0, *[0.2] * 5),
    },
    "mesp": {
        "pursuer-blocker": (0, 1, 1, 0.3, 0.3, *[0.9] * 4, 0.8),
        "spiders-fly": (1, 1, 1, 0, 0, *[0.1] * 5),
    },
    "cone": {
        "spiders-fly": (1, 1, 1, 0, 0, *[0.4] * 5),
        "role-switcher": (0, 1, 1, 1, 1, *[0.8] * 5),
    },
}


def pursuit() -> Truth:
    """Return the thesis' claims about predators."""
    truth: Truth = {}
    loss = dict(zip(METHODS, (0.2, 0.2, 0.35, 0.35, 0.5), strict=True))
    members = {2: dict.fromkeys(("homcne", "hetcne"), ()), 3: {}, 4: {}}
    members[3] = dict.fromkeys(("ccga", "mesp"), ("pursuer-blocker", "spiders-fly"))
    members[4] = {"cone": ("role-switcher", "spiders-fly")}
    for n in range(1, 11):
        level = 400 if n <= 5 else 200
        is_better = n in (4, 5, 8, 9, 10)
        for method in (*METHODS, *VARIANTS):
            is_best = method == "cone" and (is_better or n in (2, 3))
            # Types 2 and 3: above the variants (P4), yet similar to the other methods (P2).
            is_low = method in VARIANTS and n in (2, 3)
            value = level * (1.5 if is_best and is_better else 0.6 if is_low else 1)
            truth[f"team-{n}", method] = Cell(
                value,
                loss=loss.get(method, 0.35),
                seen={name: share[n - 1] for name, share in SEEN.get(method, {}).items()},
                members=members.get(n, {}).get(method, ("entrapment",)),
                idle=0.8 if method == "cone" and is_better else 0.0,
                exchange_share=shared(method),
            )
    return truth


def of_robots(method: str, n: int) -> tuple[str, ...]:
    """Return the castes in complex environment n (tables 6.9 to 6.13)."""
    if method in ("homcne", "hetcne"):
        return ("non-specialized",)
    types = ("C", "BC", "AB", "AC", "ABC", "ABC", "AB", "ABC", "ABC")[n - 1]
    jobs = ("detector", "gatherer", "constructor")
    castes = [f"{kind}-{job}" for kind in types for job in jobs]
    if n == 6 or (n, method) == (9, "ccga"):
        castes.remove("C-constructor")
    return (*castes, "non-specialized")


def gacc() -> Truth:
    """Return the thesis' claims about gathering; value is the share of all objects delivered.

    HomCNE and HetCNE are equal in it: .29 and .32 differ significantly once there are enough runs.
    """
    truth: Truth = {}
    hard = dict(zip(METHODS, (0.305, 0.305, 0.71, 0.79, 0.93), strict=True))
    hard |= dict.fromkeys(VARIANTS, 0.6)
    easy = dict(zip(METHODS, (0.475, 0.475, 0.51, 0.54, 0.55), strict=True))
    loss = dict(zip(METHODS, (0.1, 0.1, 0.3, 0.3, 0.5), strict=True))
    for n in range(1, 11):
        for method, share in easy.items():
            truth[f"simple-{n}", method] = Cell(share, several=0.0)
        for method, share in hard.items() if n < 10 else ():
            clones = 0.1 if method == "cone" else 0.5
            truth[f"complex-{n}", method] = Cell(
                share,
                loss=loss.get(method, 0.3),
                clones=clones,
                mixed=0.15,
                stage=n,
                castes=of_robots(method, n),
                exchange_share=shared(method),
            )
    return truth


def prey() -> Truth:
    """Return the thesis' claims about prey."""
    return {
        (f"shaping-{n}", method): Cell(600 if method == "cone" else 400, hidden=3.0)
        for n in range(1, 7)
        for method in METHODS
    }


TRUTHS = {
    "rover": ("rover-v2", rover),
    "pursuit": ("pursuit-v2", pursuit),
    "prey": ("prey-v2", prey),
    "gacc": ("gacc-v2", gacc),
}


def write_tables(
    folder: Path,
    world: str,
    truth: Truth,
    n: int = 20,
    noise: float = 0.03,
    *,
    preset: str = "smoke",
    variant: str = "",
    studies: bool = True,
) -> Path:
    """Write the tables of a campaign and return their folder.

    Args:
        folder: made if it is missing; tables in it are replaced.
        world: name with version.
        truth: its cells.
        n: runs per cell.
        noise: standard deviation of the runs, as a share of their mean.
        preset, variant: of all runs.
        studies: whether the champions were studied.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in SCHEMA}
    for (environment, method), cell in truth.items():
        for seed in range(1, n + 1):
            label = "-".join((environment, method, preset, variant, f"s{seed}"))
            run = f"{label}/stage-{cell.stage}" if cell.stage else label
            rows["runs"].append(
                _about(run, world, environment, method, cell, seed, preset, variant)
            )
            for table, row in _results(run, world, environment, cell, seed, n, noise, studies):
                rows[table].append(row)
    for name in ("runs", "scores", "champions", "generations", "robots", "behaviours"):
        text = folder / f"{name}.json"
        text.write_text(json.dumps(rows[name]))
        if rows[name]:
            duckdb.sql(
                f"COPY (SELECT * FROM read_json('{text}', format='array',"
                f" columns={SCHEMA[name]})) TO '{folder / name}.parquet' (FORMAT parquet)"
            )
        text.unlink()
    return folder


def _around(share: float, method: str, seed: int) -> float | None:
    """Return a run's share of pairs that exchange: for CONE's variants it differs by seed."""
    if method not in EXCHANGING:
        return None
    return share if method == "cone" else share * (1.1 if seed % 2 else 0.9)


def _about(
    run: str,
    world: str,
    environment: str,
    method: str,
    cell: Cell,
    seed: int,
    preset: str,
    variant: str,
) -> dict[str, Any]:
    family, _, number = environment.rpartition("-")
    return {
        "run": run,
        "task": f"{world}/{environment}",
        "world": world,
        "environment": environment,
        "family": family,
        "number": int(number),
        "method": method,
        "preset": preset,
        "seed": seed,
        "variant": variant,
        "generations": 10,
        "evaluations": cell.evaluations,
        "team_steps": 1000 * cell.evaluations,
        "seconds": 1.0,
        "core_seconds": 1.0,
        "stopped_by": "budget",
        "measure": MEASURES[world][0],
        "optimum": 10 * int(number) if world == "gacc-v2" else None,
        "n_robots": 20,
        "exchanges": cell.exchanges if method in EXCHANGING else None,
        "exchange_share": _around(cell.exchange_share, method, seed),
        "run_id": run,
        "conevo": "0.1.0",
        "code": "0",
        "changes": "",
        "numpy": "2.4.6",
        "warp": "1.19.0",
        "kernel_hash": "0",
    }


def _results(
    run: str,
    world: str,
    environment: str,
    cell: Cell,
    seed: int,
    n: int,
    noise: float,
    studies: bool,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of one run: seed k is the k-th of n quantiles."""
    shift = 1 + noise * NormalDist().inv_cdf((seed - 0.5) / n)
    shift_of_loss = 1 + noise * NormalDist().inv_cdf(((3 * seed) % n + 0.5) / n)
    number = int(environment.rpartition("-")[2])
    parts = 10 * number if world == "gacc-v2" else 1  # the number of objects to deliver
    value = cell.value * shift * parts

    def played(study: str, team: str, share: float = 1) -> Iterator[tuple[str, dict[str, Any]]]:
        for measure in MEASURES[world]:
            reached = share * (cell.area * shift if measure == "area" else value)
            for scenario, swing in enumerate((0.9, 1.1)):
                row = {"run": run, "study": study, "team": team, "measure": measure}
                yield "scores", row | {"scenario": scenario, "value": reached * swing}

    yield from played("test", "champion")
    yield from played("test", "generation 0", 0.1)
    for generation, hidden in ((8, cell.hidden), (9, 10.0)):
        about = {"run": run, "generation": generation, "hidden": hidden}
        yield "generations", about | {"gst": cell.gst + 0.01 * (generation - 8.5)}
    yield "champions", {"run": run, "generation": 8, "measure": MEASURES[world][0]}
    if not studies:
        return
    several = seed <= round(cell.several * n)
    castes = cell.castes or CASTES[world]
    castes = castes if several else castes[:1]
    is_predator = world == "pursuit-v2"
    for study in ("lesion", "clones"):
        yield from played(study, "whole")
    for k, caste in enumerate(castes):
        yield (
            "robots",
            {
                "run": run,
                "robot": k,
                "caste": caste,
                "specialization": 0.2,
                "fitness": 1.0,
                "hidden": 10,
            },
        )
        if caste == "non-specialized" and is_predator:
            continue
        yield from played("lesion", caste, 1 - cell.loss * shift_of_loss)
        share = cell.mixed if caste == "non-specialized" else cell.clones
        yield from played("clones", caste, share)
    if is_predator:
        for name in ("pursuer-blocker", "spiders-fly", "role-switcher"):
            yield from played("composed", name, cell.composed)
        specialists = tuple(caste for caste in castes if caste != "non-specialized")
        yield from _behaviours(run, cell, seed, n, specialists)


def _behaviours(
    run: str, cell: Cell, seed: int, n: int, specialists: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Any]]]:
    labels = dict.fromkeys(specialists, 1) | {"idle": int(seed <= round(cell.idle * n))}
    captures = {
        name: (2 + seed % 3) * int(seed <= round(cell.seen.get(name, 0.0) * n))
        for name in ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher", "none")
    }
    members = dict.fromkeys((*captures, "non-specialized"), 0) | {"non-specialized": 1}
    members |= dict.fromkeys(cell.members, 1)
    of_kinds = {"individual": labels, "collective": captures, "member": members}
    for kind, counts in of_kinds.items():
        for name, count in counts.items():
            yield "behaviours", {"run": run, "kind": kind, "behaviour": name, "count": count}
    usual = max(captures, key=lambda name: captures[name])
    yield (
        "behaviours",
        {
            "run": run,
            "kind": "team",
            "behaviour": usual,
            "count": sum(captures.values()),
        },
    )
