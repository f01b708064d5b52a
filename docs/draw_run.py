"""Draw one run of the multi-rover world: ``python docs/draw_run.py RUN [PICTURE]``.

Left: task performance and castes of each generation's fittest team. Right: the run's champion in
one scenario of its testing phase, the one whose value is nearest to the median: canals, rocks,
the rovers' paths. The default place is ``docs/pictures/run-WORLD-METHOD-PRESET.png``.
"""

import argparse
import io
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import MaxNLocator

from conevo import Rollout, Run
from conevo.rng import fold
from conevo.specialization.individual import NON_SPECIALIZED, degree, label

matplotlib.rcParams.update({"hatch.color": "white", "hatch.linewidth": 0.6})
PICTURES = Path(__file__).parent / "pictures"
# Caste by caste: colour (Okabe and Ito 2008), line, marker, hatch. Colours differ in lightness too,
# so the picture can be read in grey and by readers who see few colours.
STYLES = (
    ("#E69F00", "-", "o", "..."),
    ("#0072B2", "--", "s", "///"),
    ("#56B4E9", "-.", "^", "---"),
    ("#2B2B50", ":", "D", ""),
    ("#9A9A9A", "-", "X", "xxx"),
)


def styles(castes):
    """Return the style of each caste, the non-specialized last."""
    return dict(zip((*castes, NON_SPECIALIZED), STYLES, strict=True))


def world_of(run):
    """Return the world a run was made in."""
    return run.config.build_world()


def replay(run, scenario):
    """Play a run's champion once more in a scenario of its testing phase.

    Returns:
        The scenarios object, paths x and y [T, R], each rover's caste [R], which rocks were
        detected [K], and the value the lander recorded.
    """
    world = world_of(run)
    rollout = Rollout(world, run.config.controller, n_threads=1)
    scene = world.scenarios([fold(run.config.run.seed, "test", scenario)])
    genes, teams = run.champion.as_trial()
    seen = rollout.record(genes, teams[0], scene)
    detected = seen["detected"] < 2**31 - 1
    outcome = rollout.evaluate(genes, teams, scene)
    s = degree(outcome.switches[0, 0], outcome.counts[0, 0])
    castes = [
        label(float(one), counts, world.castes)
        for one, counts in zip(s, outcome.counts[0, 0], strict=True)
    ]
    return scene, seen["x"], seen["y"], castes, detected, float(outcome.performance["value"][0, 0])


def median_scenario(run):
    """Return the number of the test scenario whose value is nearest to the median."""
    values = np.array(run.test_result["champion"]["performance"]["value"]["values"])
    return int(np.abs(values - np.median(values)).argmin())


def draw_learning(ax, run):
    """Draw the value of each generation's fittest team, and where the champion is from."""
    records = run.generations()
    generation = [record["generation"] for record in records]
    value = [record["performance"]["value"] for record in records]
    ax.plot(generation, value, color="#0072B2", linewidth=1.1)
    champion = run.champion.generation
    ax.plot(champion, value[champion], "ko", markersize=5, clip_on=False, label="champion")
    ax.set_ylabel("value detected (of 5000)")
    ax.set_ylim(bottom=0)
    ax.legend(loc="lower right", frameon=False)
    ax.set_title("Fittest team of each generation", loc="left")


def draw_castes(ax, run, looks):
    """Draw how many rovers of each generation's fittest team belong to each caste."""
    records = run.generations()
    generation = [record["generation"] for record in records]
    below = np.zeros(len(records))
    for caste, (colour, _, _, hatch) in looks.items():
        size = np.array([record["castes"].get(caste, 0) for record in records])
        if size.any():
            look = {"facecolor": colour, "hatch": hatch, "linewidth": 0}
            ax.fill_between(generation, below, below + size, step="mid", label=caste, **look)
        below = below + size
    ax.set(ylabel="rovers", xlabel="generation", ylim=(0, below.max()))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_title("Its castes", loc="left")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, reverse=True)


def draw_world(ax, run, looks):
    """Draw the champion's paths in the world, and what it detected there."""
    scenario = median_scenario(run)
    scene, x, y, castes, detected, value = replay(run, scenario)
    canal = np.where(scene.canal > 0, 0.16, 0.0)
    ax.imshow(canal, cmap="Greys", vmin=0, vmax=1, origin="lower", extent=(0, 1, 0, 1))
    rocks = np.stack([scene.rock_x[0], scene.rock_y[0]])
    for which, size, colour, name in (
        (~detected, 1.4, "#8C8C8C", "rock, undetected"),
        (detected, 9.0, "#8B1A00", "rock, detected"),
    ):
        ax.scatter(*rocks[:, which], s=size, color=colour, linewidth=0)
        ax.plot([], [], "o", color=colour, ms=3 if size < 2 else 5, mec="none", label=name)
    for robot, caste in enumerate(castes):
        colour, line, marker, _ = looks[caste]
        ax.plot(x[:, robot], y[:, robot], color=colour, linestyle=line, linewidth=0.9, alpha=0.9)
        ax.plot(x[-1, robot], y[-1, robot], marker, color=colour, mec="white", mew=0.7, ms=7)
    for caste, (colour, line, marker, _) in looks.items():
        if caste in castes:
            name = f"{caste}: {castes.count(caste)}"
            ax.plot([], [], line, color=colour, marker=marker, mec="white", ms=7, label=name)
    ax.set(xlim=(0, 1), ylim=(0, 1), xticks=(0, 0.5, 1), yticks=(0, 0.5, 1), aspect="equal")
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False, markerscale=1.2)
    ax.set_title(f"The champion in a fresh scenario: {value:.0f} of 5000 detected", loc="left")


def title(run):
    """Return two lines: what was run at what cost, and what the testing phase found."""
    config, last, tested = run.config, run.generations()[-1], run.test_result
    champion, first = (
        tested[team]["performance"]["value"] for team in ("champion", "generation_0")
    )
    return (
        f"{config.task}, {config.method}, preset {config.preset}, seed {config.run.seed}, "
        f"{last['team_evaluations']:,} team evaluations\n"
        f"Testing phase, {tested['champion']['scenarios']} fresh scenarios: value "
        f"{champion['mean']:.0f} (sd {champion['sd']:.0f}); "
        f"fittest team of generation 0: {first['mean']:.0f} (sd {first['sd']:.0f})"
    )


def draw(run, picture):
    """Write the picture of a finished run of the multi-rover world."""
    looks = styles(world_of(run).castes)
    figure, axes = plt.subplot_mosaic(
        [["learning", "world"], ["castes", "world"]],
        figsize=(12.5, 5.6),
        width_ratios=(1, 1.5),
        layout="constrained",
    )
    draw_learning(axes["learning"], run)
    draw_castes(axes["castes"], run, looks)
    draw_world(axes["world"], run, looks)
    axes["learning"].sharex(axes["castes"])
    axes["castes"].margins(x=0)
    figure.suptitle(title(run), fontsize=11, x=0.01, ha="left")
    full = io.BytesIO()
    figure.savefig(full, dpi=110)
    plt.close(figure)
    picture.parent.mkdir(parents=True, exist_ok=True)
    Image.open(full).convert("RGB").quantize(128).save(picture, optimize=True)


def main():
    """Read the command line and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("picture", type=Path, nargs="?")
    chosen = parser.parse_args()
    run = Run(chosen.run)
    config = run.config
    if run.test_result is None or not config.world.startswith("rover-"):
        parser.error(f"{run.path} is no finished run of the multi-rover world")
    name = f"run-{config.task.replace('/', '-')}-{config.method}-{config.preset}.png"
    picture = chosen.picture or PICTURES / name
    draw(run, picture)
    print(picture)


if __name__ == "__main__":
    main()
