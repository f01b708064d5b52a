"""Results as BenchMARL writes them with ``create_json``: one file per run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FRAMES = 60_000  # of one batch
EPISODES = 3


def run_data(means: list[float], episodes: int = EPISODES) -> dict[str, Any]:
    """Return one run: absolute metrics first, which are the best single episodes."""
    steps: dict[str, Any] = {}
    for k, mean in enumerate(means):
        returns = [mean + 10.0 * (n - (episodes - 1) / 2) for n in range(episodes)]
        steps[f"step_{10 * k}"] = {
            "step_count": FRAMES * (k + 1),
            "predators_return": returns,
            "return": returns,
        }
    best = max(one["return"][-1] for one in steps.values())
    return {"absolute_metrics": {"predators_return": [best], "return": [best]}} | steps


def write(folder: Path, means: dict[int, list[float]], task: str = "pursuit_team_4") -> list[Path]:
    """Write a file for each seed."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for seed, of in means.items():
        paths.append(folder / f"mappo_{task}_{seed}.json")
        data = {"conevo": {task: {"mappo": {f"seed_{seed}": run_data(of)}}}}
        paths[-1].write_text(json.dumps(data, indent=4))
    return paths


DESCRIPTION = """
robots = 20
machine = "one core"
scenarios = "fresh, 3 per evaluation"

[measures]
return = "capture_time"

[algorithms.mappo]
seconds = 541.0
parameters = 5573
shared = true
memory = "none"
actions = "5 discrete"
policy = "stochastic"
"""


def describe(paths: list[Path], text: str = DESCRIPTION) -> None:
    """Write the description of each file."""
    for path in paths:
        path.with_suffix(".toml").write_text(text)
