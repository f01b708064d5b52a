"""Run folders written by hand, for tests of the live page, which follows them."""

import dataclasses
import fcntl
import json
import os
from contextlib import contextmanager

import tomli_w

from conevo.campaigns.campaign import create
from conevo.campaigns.plan_file import read_plan
from conevo.runs.outline import digest_of, identify

PLAN = """
[campaign]
name = "three"
title = "Two methods, two seeds"
seeds = [1, 2]
preset = "smoke"
studies = []

[factors]
world = ["rover/complex-1"]
method = ["homcne", "mesp"]

[settings]
"run.generations" = 4
"""


def record(generation, **changes):
    """Return the record of a generation; fitness and performance grow with it."""
    return {
        "generation": generation,
        "team_evaluations": 100 * (generation + 1),
        "team_steps": 1000 * (generation + 1),
        "seconds": 2.0,
        "best_fitness": 20.0 + generation,
        "mean_fitness": 5.0 + generation,
        "team_fitness": 10.0 + generation,
        "performance": {"value": 1.0 + generation, "area": 0.5},
        "castes": {"low": 2, "non-specialized": 1},
        "favourites": {"low": 2, "hi": 1},
        "favourite_share": 0.75,
        "specialization": 0.25,
        "sst": 0.5,
        "gst": 0.2,
        "recombinations": 0,
        "n_hidden": [10, 12, 8],
        "n_nonfinite": 0,
    } | changes


def tables(method="cone", seed=1, world="rover-v2/complex-1", generations=10, budget=0, **settings):
    """Return the displayed part of a run's configuration; settings are given as method__gst=0.2."""
    names = {"world": world, "method": method, "preset": "desk", "seed": seed}
    run = names | {"generations": generations, "budget_evaluations": budget}
    found = {"run": run, "world": {}, "method": {}}
    for key, value in settings.items():
        part, _, name = key.partition("__")
        found[part][name] = value
    return found


def provenance(config, **changes):
    """Return the provenance of a run, given the text of its configuration."""
    names = ("preset", "command", "device", "created", "conevo", "python", "numpy", "warp")
    about = dict.fromkeys((*names, "platform", "cpu"), "made up")
    about |= {"run_id": "0" * 12, "kernel_hash": "0" * 16, "sessions": []}
    return about | {"config_digest": digest_of(config.encode())} | changes


def session(**made):
    """Return one session of a run."""
    return {"started": "now", "from_generation": 0, "threads": 1} | made


def append(path, *records, torn=""):
    """Add lines to a run's log, and the beginning of an incomplete one."""
    with (path / "generations.jsonl").open("a", encoding="utf-8") as file:
        file.write("".join(f"{json.dumps(one)}\n" for one in records) + torn)


def write_run(path, n=3, is_finished=False, torn="", about=None, **settings):
    """Write a run of n generations; about: further entries of its provenance."""
    path.mkdir(parents=True)
    ending = {"finished": "now", "stopped_by": "generations"} if is_finished else {}
    configure(path, (about or {}) | ending, **settings)
    (path / "generations.jsonl").touch()
    append(path, *(record(k) for k in range(n)), torn=torn)
    if is_finished:
        (path / "DONE").write_text('{"files": {}}')
    return path


def configure(path, about, **settings):
    """Write the configuration and the provenance of a run."""
    config = tomli_w.dumps(tables(**settings))
    (path / "config.toml").write_text(config)
    (path / "provenance.json").write_text(json.dumps(provenance(config, **about)))


def write_shaping(path, stages):
    """Write a shaping with stages of (generations planned, finished); None if not started yet."""
    path.mkdir(parents=True)
    worlds = [f"rover-v2/complex-{k}" for k in range(1, len(stages) + 1)]
    planned = [
        tables(world=world, generations=of) for world, (of, _) in zip(worlds, stages, strict=True)
    ]
    ids = [identify(one, one["run"]["world"]) for one in planned]
    head = {"format": 1, "command": "made up", "device": "cpu", "tasks": worlds, "run_ids": ids}
    (path / "shaping.toml").write_text(tomli_w.dumps(head | {"stages": planned}))
    for k, (of, done) in enumerate(stages, start=1):
        if done is not None:
            write_run(path / f"stage-{k}", done, world=worlds[k - 1], generations=of)
    return path


def write_campaign(path):
    """Write a campaign of homcne and mesp with two seeds; no run has started."""
    file = path.with_suffix(".toml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(PLAN)
    campaign = create(dataclasses.replace(read_plan(file)), path)
    file.unlink()
    return campaign


@contextmanager
def locked(path):
    """Hold a directory's lock, as a process that works there does."""
    handle = os.open(path / "lock", os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)
