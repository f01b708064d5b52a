"""Draw the teams that runs of MAP-Elites or novelty search have found, by their behaviour.

One panel for each run::

    conevo run examples/light.py:dark-1 --method map-elites --out runs/clones
    conevo run examples/light.py:dark-1 --method map-elites --set method.team=whole --out runs/whole
    python experiments/draw_team_map.py runs/clones runs/whole --out map.png
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import conevo
from conevo.reading import read_arrays

AXES = {
    "division": ("difference of two robots", "evenness of actions"),
    "switching": ("difference of S", "mean S"),
}


def newest_map(run: Path) -> np.ndarray:
    """Return the best fitness [bins, bins] in a run's newest checkpoint; NaN in empty cells.

    Raises:
        ValueError: its method has no map of teams.
    """
    found = {}
    for path in sorted(run.glob("checkpoint-[ab].npz")):
        arrays = read_arrays(path)
        fields = json.loads(arrays["about"].tobytes())["fields"]
        if "field.map.fitness" not in arrays:
            raise ValueError(f"{run}: its method has no map of teams")
        found[fields["progress.generation"]] = arrays["field.map.fitness"]
    fitness = found[max(found)]
    bins = round(len(fitness) ** 0.5)
    return fitness.reshape(bins, bins)


def draw(runs: list[Path], picture: Path) -> None:
    """Write a picture with a panel for each run, all with one scale of fitness."""
    maps = [newest_map(run) for run in runs]
    low, high = (limit([limit(one) for one in maps]) for limit in (np.nanmin, np.nanmax))
    size = (4.2 * len(runs) + 1, 4.2)
    figure, axes = plt.subplots(1, len(runs), figsize=size, layout="constrained", squeeze=False)
    for run, cells, ax in zip(runs, maps, axes.flat, strict=True):
        config = conevo.Run(run).config
        image = ax.imshow(cells, vmin=low, vmax=high, origin="lower", extent=(0, 1, 0, 1))
        share = np.isfinite(cells).mean()
        ax.set_title(
            f"{config.method}, {config.method_config.team}: {share:.0%} of the cells", fontsize=10
        )
        behaviour = config.method_config.behaviour
        x, y = AXES["switching" if behaviour == "switching" else "division"]
        ax.set_xlabel(x)
        ax.set_ylabel(y)
    figure.colorbar(image, ax=axes, label="best fitness")
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def main() -> None:
    """Draw the runs named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="picture, .png or .svg")
    asked = parser.parse_args()
    draw(asked.runs, asked.out)


if __name__ == "__main__":
    main()
