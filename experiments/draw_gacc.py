"""Draw a scenario of gathering and construction: ``python experiments/draw_gacc.py [--run RUN]``.

Left: the start of an epoch: home area, construction zone, obstacles, objects, robots. Right: the
same epoch at its end, with the paths of carried objects and the complex objects built. It is played
by a mix of heuristic controllers, or by the champion of a run.
"""

import argparse
import io
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle

import conevo
from conevo.rng import fold
from conevo.worlds.gacc.state import CARRIED, DELIVERED, DROPPED, HELPED, LYING, WAITING
from teams import champion, controlled

PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "gacc.png"
ENVIRONMENT = "complex-5"
# Colours of Okabe and Ito (2008), which differ in lightness too; every type has its own marker.
TYPES = (("A", "#0072B2", "o"), ("B", "#E69F00", "s"), ("C", "#B3446C", "^"))
ROBOT = "#3A3A3A"
MIX = (0, 0, 0, 15, 8, 6, 0, 0, 0, 1)  # robots of each heuristic: gatherers do best


def draw_place(ax, world, scene):
    """Draw the fixed things: home area, construction zone, obstacles."""
    p = world.params
    for side, face, name in ((p.home_side, "#F1E7D3", "home area"), (p.zone_side, "#FFFFFF", "")):
        corner = (0.5 - side / 2, 0.5 - side / 2)
        look = {"facecolor": face, "edgecolor": "#9C8557", "linewidth": 0.8, "zorder": 0}
        ax.add_patch(Rectangle(corner, side, side, **look))
        if name:
            at = (0.5, corner[1] + 0.012)
            ax.annotate(name, at, ha="center", fontsize=8, color="#7A6437")
    for left, bottom, right, top in zip(
        scene.left[0], scene.bottom[0], scene.right[0], scene.top[0], strict=True
    ):
        size = (right - left, top - bottom)
        ax.add_patch(Rectangle((left, bottom), *size, facecolor="#8F8F8F", edgecolor="#5C5C5C"))
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xticks=(0, 0.5, 1), yticks=(0, 0.5, 1))


def draw_objects(ax, types, x, y, which, **look):
    """Draw some objects, every type with its own colour and marker."""
    for kind, (_, colour, marker) in enumerate(TYPES):
        some = which & (types == kind)
        ax.plot(
            x[some], y[some], marker, color=colour, markersize=6.5, mec="white", mew=0.6, **look
        )


def draw_start(ax, world, scene):
    """Draw the start of the epoch, and the range of one robot's sensors."""
    draw_place(ax, world, scene)
    types = scene.object_type[0]
    draw_objects(ax, types, scene.object_x[0], scene.object_y[0], types >= 0)
    x, y = scene.start_x[0], scene.start_y[0]
    ax.plot(x, y, "D", color=ROBOT, markersize=3.5)
    one = int(np.argmin(np.hypot(x - 0.2, y - 0.3)))
    ring = {"facecolor": "none", "edgecolor": ROBOT, "linestyle": ":"}
    ax.add_patch(Circle((x[one], y[one]), world.params.object_range, **ring))
    ax.set_title(f"An epoch of gacc/{world.environment} begins", loc="left", fontsize=10)


def draw_legend(ax):
    """Draw the legend."""
    shown = [
        Line2D([], [], marker=marker, color=colour, linestyle="", label=f"object {name}")
        for name, colour, marker in TYPES
    ]
    shown.append(Line2D([], [], marker="D", color=ROBOT, linestyle="", ms=4, label="robot"))
    shown.append(Line2D([], [], color=ROBOT, linestyle=":", label="range of its sensors"))
    shown.append(Rectangle((0, 0), 1, 1, facecolor="#8F8F8F", label="obstacle"))
    ax.legend(handles=shown, ncols=3, loc="center", frameon=False, fontsize=9)
    ax.axis("off")


def draw_end(ax, world, scene, seen, who):
    """Draw the paths of carried objects, and the final places of all things."""
    draw_place(ax, world, scene)
    types, life = scene.object_type[0], seen["life"]
    for k in np.flatnonzero((life[-1] >= WAITING) & (life[-1] <= DELIVERED)):
        x = np.concatenate([scene.object_x[0][k : k + 1], seen["object_x"][:, k]])
        y = np.concatenate([scene.object_y[0][k : k + 1], seen["object_y"][:, k]])
        last = int(np.argmax(life[:, k] == DELIVERED)) or len(life)
        look = {"color": TYPES[types[k]][1], "zorder": 1, "linewidth": 1}
        ax.plot(x[: last + 1], y[: last + 1], **look)
        if life[-1, k] == DELIVERED:
            ax.plot((x[last], x[-1]), (y[last], y[-1]), linestyle=":", **look)
    x, y, now = seen["object_x"][-1], seen["object_y"][-1], life[-1]
    moved = (now >= CARRIED) & (now <= HELPED)
    draw_objects(ax, types, x, y, (now == LYING) | (now == DROPPED) | moved, zorder=3)
    for kind, (_, colour, _) in enumerate(TYPES):
        some = (now == DELIVERED) & (types == kind)
        ax.plot(x[some], y[some], "s", color=colour, markersize=1.5, zorder=3)
    ax.plot(seen["x"][-1], seen["y"][-1], "D", color=ROBOT, markersize=3.5, zorder=2)
    done = int((now == DELIVERED).sum())
    waiting = int(((now >= WAITING) & (now <= HELPED)).sum())
    text = f"{done} of {len(types)} are built in"
    text += f", {waiting} waiting for help" if waiting else ""
    ax.set_title(f"After {len(life)} iterations of {who}: {text}", loc="left", fontsize=10)


def draw_built(ax, world, scene, seen):
    """Draw the complex objects as rows of parts: filled if in place, empty if missing."""
    types, part = scene.object_type[0], seen["part"][-1]
    n_complex, n_parts = scene.plan.shape
    for c in range(n_complex):
        done = [int(types[part == c * n_parts + step][0]) for step in range(n_parts)
                if (part == c * n_parts + step).any()]  # fmt: skip
        rest = scene.plan[c].tolist()
        for kind in done:
            rest.remove(kind)  # of an ordered one, always its first
        ordered = "in this order" if world.plan.is_ordered[c] else "in any order"
        ax.annotate(f"to build, {ordered}", (-0.2, -c), fontsize=8, ha="right", va="center")
        for step, kind in enumerate([*done, *rest]):
            name, colour, _ = TYPES[kind]
            is_done = step < len(done)
            look = {"facecolor": colour if is_done else "white", "edgecolor": colour}
            ax.add_patch(Rectangle((step, -c - 0.4), 0.8, 0.8, **look))
            ax.annotate(name, (step + 0.4, -c), fontsize=8, ha="center", va="center",
                        color="white" if is_done else colour)  # fmt: skip
    ax.set(xlim=(-5, n_parts + 3), ylim=(-n_complex + 0.4, 0.6), aspect="equal", anchor="N")
    ax.axis("off")


def main():
    """Write ``pictures/gacc.png``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--run", help="whose champion plays; by default heuristic robots do")
    parser.add_argument("--seed", type=int, default=11, help="of the epoch")
    options = parser.parse_args()
    if options.run:
        run = conevo.Run(options.run)
        config = run.config
        world = conevo.WORLDS[config.world].build(config.environment, config.world_params)
        teams, who = champion(run, "champion"), "a champion"
    else:
        world = conevo.world(f"gacc/{ENVIRONMENT}")
        who = "heuristic robots"
        teams = controlled(world, "mix", np.repeat(np.arange(len(MIX)), MIX))
    scene = world.scenarios([fold(options.seed, "draw_gacc")])
    rollout = conevo.Rollout(world, n_threads=1)
    seen = rollout.record(teams.genes, teams.slots[0], scene, teams.heuristic[0])
    figure, axes = plt.subplot_mosaic(
        [["start", "end"], ["legend", "built"]],
        figsize=(12, 7),
        height_ratios=(1, 0.13),
        layout="constrained",
    )
    draw_start(axes["start"], world, scene)
    draw_legend(axes["legend"])
    draw_end(axes["end"], world, scene, seen, who)
    draw_built(axes["built"], world, scene, seen)
    full = io.BytesIO()
    figure.savefig(full, dpi=80)
    PICTURE.parent.mkdir(exist_ok=True)
    Image.open(full).convert("RGB").quantize(48).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
