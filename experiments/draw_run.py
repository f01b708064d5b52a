"""Draw one run of the multi-rover world, and another next to it if one is named.

    python experiments/draw_run.py RUN [--next-to OTHER] [--out PICTURE]

Left: the task performance of each generation's fittest team, and the settings that the champion's
rovers use in the testing phase, by the region in which they start. Right: the champion in the
scenario of that phase with the value nearest to the median: canals, rocks, the rovers' paths. The
default place is ``docs/pictures/run-WORLD-METHOD-PRESET-sSEED.png``.
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
from conevo.errors import ConevoError
from conevo.evolution.methods.registry import title_of
from conevo.rng import fold
from conevo.specialization.favourite import favourite
from conevo.worlds.rover import rocks
from conevo.worlds.rover.sites import N_REGIONS, rock_sites

matplotlib.rcParams.update({"hatch.color": "white", "hatch.linewidth": 0.6})
PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
# For each setting: colour (Okabe and Ito 2008), line, marker, hatch. Colours differ in lightness
# too, so the picture can be read in grey and by readers with any kind of colour vision.
STYLES = {
    "low": ("#E69F00", "-", "o", "..."),
    "med": ("#56B4E9", "-.", "^", "---"),
    "hi": ("#2B2B50", "--", "s", "///"),
    None: ("#9A9A9A", ":", "X", "xxx"),
}
PAIRS = ("low, low", "low, med", "med, hi", "hi, hi")  # settings of two rovers that detect a type


def world_of(run):
    """Return the world of a run."""
    return run.config.build_world()


def champion_in(run, scenarios):
    """Play a run's champion once more in scenarios of its testing phase.

    Returns:
        The scenarios object, its weights and teams, and the outcome.
    """
    world = world_of(run)
    rollout = Rollout(world, run.config.controller, n_threads=1)
    scene = world.scenarios([fold(run.config.run.seed, "test", one) for one in scenarios])
    genes, teams = run.champion.as_trial()
    return rollout, scene, genes, teams, rollout.evaluate(genes, teams, scene)


def settings_used(run, outcome):
    """Return how often each rover used each setting, [R, settings], over all scenarios."""
    world = world_of(run)
    chosen = [world.castes.index(name) for name in world.settings]
    return outcome.counts[0].sum(axis=0)[:, chosen]


def replay(run, scenario):
    """Play a run's champion once more in a scenario of its testing phase.

    Returns:
        The scenarios object, paths x and y [T, R], the setting that each rover uses most [R],
        whether each rock was detected [K], and the value that the lander recorded.
    """
    rollout, scene, genes, teams, outcome = champion_in(run, [scenario])
    seen = rollout.record(genes, teams[0], scene)
    detected = seen["detected"] < 2**31 - 1
    settings = world_of(run).settings
    favourites = [favourite(counts, settings) for counts in settings_used(run, outcome)]
    value = float(outcome.performance["value"][0, 0])
    return scene, seen["x"], seen["y"], favourites, detected, value


def median_scenario(run):
    """Return the number of the test scenario whose value is nearest to the median."""
    values = np.array(run.test_result["champion"]["performance"]["value"]["values"])
    return int(np.abs(values - np.median(values)).argmin())


def draw_learning(ax, runs):
    """Draw the value of each generation's fittest team, and the champion's generation."""
    for run, look in zip(runs, ("-", ":"), strict=False):
        records = run.generations()
        spent = [record["team_evaluations"] for record in records]
        value = [record["performance"]["value"] for record in records]
        colour = "#0072B2" if look == "-" else "#8C8C8C"
        ax.plot(spent, value, look, color=colour, linewidth=1.1, label=title_of(run.config.method))
        at = run.champion.generation
        name = "champion" if look == "-" else None
        ax.plot(spent[at], value[at], "ko", markersize=5, clip_on=False, label=name)
    ax.set(ylabel="value detected (of 5000)", xlabel="team evaluations")
    ax.set_ylim(bottom=0)
    ax.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    ax.legend(loc="lower right", frameon=False)
    ax.set_title("Fittest team of each generation", loc="left")


def draw_settings(ax, runs):
    """Draw the share of each setting among those used by the champions' rovers, by region."""
    ticks, places, at = [], [], 0.0
    for run in runs:
        world = world_of(run)
        *_, outcome = champion_in(run, range(run.test_result["champion"]["scenarios"]))
        counts = settings_used(run, outcome)
        is_placed = run.config.world_params.starts == "by_robot"
        groups = N_REGIONS if is_placed else 1
        for region in range(groups):
            used = counts[np.arange(len(counts)) % groups == region].sum(axis=0)
            below = 0.0
            for setting, share in zip(world.settings, used / max(used.sum(), 1), strict=True):
                colour, _, _, hatch = STYLES[setting]
                ax.bar(at, share, 0.85, below, color=colour, hatch=hatch, linewidth=0)
                below += share
            ticks.append(rocks.TYPES[region] if is_placed else "all")
            places.append(at)
            at += 1.0
        middle = (places[-groups] + places[-1]) / 2
        ax.text(middle, 1.03, title_of(run.config.method), ha="center", va="bottom")
        at += 0.7
    ax.set(xticks=places, xticklabels=ticks, yticks=(0, 0.5, 1), ylim=(0, 1))
    ax.set(ylabel="share of settings used", xlabel="rovers that begin in the region of type")
    for setting, (colour, _, _, hatch) in STYLES.items():
        if setting:
            ax.bar(0, 0, color=colour, hatch=hatch, linewidth=0, label=setting)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, reverse=True)


def draw_regions(ax, run):
    """Draw the lines between regions, and the type of each, if types have regions."""
    if not run.config.world_params.segregation:
        return
    sites = rock_sites(rocks.layout(run.config.environment))
    x, left, right = map(float, sites.cuts)
    ax.plot([x, x], [0, 1], color="#CC79A7", linewidth=0.9)
    ax.plot([0, x], [left, left], color="#CC79A7", linewidth=0.9)
    ax.plot([x, 1], [right, right], color="#CC79A7", linewidth=0.9)
    corners = ((0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98))
    for (at, up), kind, pair in zip(corners, rocks.TYPES, PAIRS, strict=False):
        ax.text(
            at,
            up,
            f"{kind} ({pair})",
            ha="left" if at < 0.5 else "right",
            va="bottom" if up < 0.5 else "top",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
        )


def draw_world(ax, run):
    """Draw the champion's paths in the world, and its detected rocks."""
    scenario = median_scenario(run)
    scene, x, y, favourites, detected, value = replay(run, scenario)
    canal = np.where(scene.canal > 0, 0.16, 0.0)
    ax.imshow(canal, cmap="Greys", vmin=0, vmax=1, origin="lower", extent=(0, 1, 0, 1))
    at = np.stack([scene.rock_x[0], scene.rock_y[0]])
    for which, size, colour, name in (
        (~detected, 1.4, "#8C8C8C", "rock, undetected"),
        (detected, 9.0, "#8B1A00", "rock, detected"),
    ):
        ax.scatter(*at[:, which], s=size, color=colour, linewidth=0)
        ax.plot([], [], "o", color=colour, ms=3 if size < 2 else 5, mec="none", label=name)
    for robot, setting in enumerate(favourites):
        colour, line, marker, _ = STYLES[setting]
        ax.plot(x[:, robot], y[:, robot], color=colour, linestyle=line, linewidth=0.9, alpha=0.9)
        ax.plot(x[-1, robot], y[-1, robot], marker, color=colour, mec="white", mew=0.7, ms=7)
    for setting, (colour, line, marker, _) in STYLES.items():
        if setting in favourites:
            name = f"{favourites.count(setting)} whose favourite is {setting or 'none'}"
            ax.plot([], [], line, color=colour, marker=marker, mec="white", ms=7, label=name)
    draw_regions(ax, run)
    ax.set(xlim=(0, 1), ylim=(0, 1), xticks=(0, 0.5, 1), yticks=(0, 0.5, 1), aspect="equal")
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False, markerscale=1.2)
    method = title_of(run.config.method)
    ax.set_title(f"Champion of {method} in a fresh scenario: {value:.0f} of 5000", loc="left")


def title(runs):
    """Return a line for each run: settings, cost and results of the testing phase."""
    lines = []
    for run in runs:
        config, last, tested = run.config, run.generations()[-1], run.test_result
        champion, first = (
            tested[team]["performance"]["value"] for team in ("champion", "generation_0")
        )
        lines.append(
            f"{title_of(config.method)}: {config.task}, preset {config.preset}, seed "
            f"{config.run.seed}, {last['team_evaluations']:,} team evaluations. Champion in "
            f"{tested['champion']['scenarios']} fresh scenarios: {champion['mean']:.0f} (sd "
            f"{champion['sd']:.0f}); generation 0: {first['mean']:.0f} (sd {first['sd']:.0f})"
        )
    return "\n".join(lines)


def draw(runs, picture):
    """Write the picture of a finished run of the multi-rover world, or of two."""
    figure, axes = plt.subplot_mosaic(
        [["learning", "world"], ["settings", "world"]],
        figsize=(12.5, 5.8),
        width_ratios=(1, 1.5),
        layout="constrained",
    )
    draw_learning(axes["learning"], runs)
    draw_settings(axes["settings"], runs)
    draw_world(axes["world"], runs[0])
    figure.suptitle(title(runs), fontsize=10, x=0.01, ha="left")
    full = io.BytesIO()
    figure.savefig(full, dpi=110)
    plt.close(figure)
    picture.parent.mkdir(parents=True, exist_ok=True)
    Image.open(full).convert("RGB").quantize(128).save(picture, optimize=True)


def main():
    """Read the command line and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("--next-to", type=Path, help="another run, for the left side")
    parser.add_argument("--out", type=Path, help="the picture to write")
    chosen = parser.parse_args()
    try:
        runs = [Run(path) for path in (chosen.run, chosen.next_to) if path]
    except ConevoError as error:
        parser.error(str(error))
    for run in runs:
        if not run.config.world.startswith("rover-"):
            parser.error(f"{run.path} is a run in {run.config.world}, not in the multi-rover world")
        if run.test_result is None:
            parser.error(f"{run.path} is not finished")
    if chosen.out and chosen.out.suffix != ".png":
        parser.error(f"--out {chosen.out}: must end in .png")
    config = runs[0].config
    about = (config.task.replace("/", "-"), config.method, config.preset, f"s{config.run.seed}")
    name = f"run-{'-'.join(about)}.png"
    picture = chosen.out or PICTURES / name
    draw(runs, picture)
    print(picture)


if __name__ == "__main__":
    main()
