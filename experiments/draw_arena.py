"""Draw a Khepera's sensors and an epoch of pursuit-evasion: ``python experiments/draw_arena.py``.

Left: the places and cones of the eight infrared (and, on predators, eight light) sensors. Right:
the first iterations of an epoch of four heuristic predators and the default prey, up to a little
after the first capture.
"""

import argparse
import io
import math
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Circle, Rectangle, Wedge

import conevo
from conevo.kernels import khepera
from conevo.rng import fold
from teams import controlled

PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "arena.png"
PREDATORS = ("#0072B2", "#56B4E9", "#2B2B50", "#7A9A4B", "#5E4B8B", "#3B7A78")
PREY = "#D55E00"
RADIUS = float(khepera.RADIUS)


def draw_sensors(ax, params):
    """Draw one robot looking up, with the cones of its sensors."""
    angle = params.sensor_angle_deg
    left = list(zip(khepera._PLACE, khepera._LOOK, strict=True))  # SI-0 to SI-3
    right = [(-place, -look) for place, look in reversed(left)]  # SI-4 to SI-7 mirror them
    for k, (place, look) in enumerate(left + right):
        x, y = (RADIUS * f(place + math.pi / 2) for f in (math.cos, math.sin))
        middle = math.degrees(look) + 90
        cone = {"facecolor": "#E69F00", "edgecolor": "#8A5F00", "linewidth": 0.6}
        span = (middle - angle, middle + angle)
        ax.add_patch(Wedge((x, y), params.sensor_range_cm, *span, alpha=0.18, **cone))
        ax.plot(x, y, "s", color="#8A5F00", markersize=3, zorder=4)
        far = params.sensor_range_cm + 2.2
        if k in (3, 4):  # both look straight back
            middle += 7 if k == 4 else -7
        at = (x + far * math.cos(math.radians(middle)), y + far * math.sin(math.radians(middle)))
        ax.annotate(f"SI-{k}", at, ha="center", va="center", fontsize=8)
    ax.add_patch(Circle((0, 0), RADIUS, facecolor="white", edgecolor="black", zorder=3))
    for side, name in ((-1, "MO-0"), (1, "MO-1")):
        wheel = (side * float(khepera.AXLE) / 2 - 0.25, -0.75)
        ax.add_patch(Rectangle(wheel, 0.5, 1.5, facecolor="black", zorder=4))
        ax.annotate(name, (side * 7.5, -1.9), fontsize=7, ha="center")
    ax.annotate("", (0, 2.4), (0, -1), arrowprops={"arrowstyle": "-|>", "color": "black"}, zorder=5)
    span = params.sensor_range_cm + RADIUS + 4
    ax.set(xlim=(-span, span), ylim=(-span, span), aspect="equal", xlabel="cm", ylabel="cm")
    reach = f"{params.sensor_range_cm:g} cm, {2 * angle:g} degrees"
    ax.set_title(f"The sensors: eight cones, {reach}", loc="left", fontsize=10)


def draw_epoch(ax, world, seed):
    """Draw the paths of predators and prey up to a little after the first capture."""
    scene = world.scenarios([fold(seed, "draw_arena")])
    teams = controlled(world, "heuristic", 0)
    rollout = conevo.Rollout(world, n_threads=1)
    seen = rollout.record(teams.genes, teams.slots[0], scene, teams.heuristic[0])
    caught = np.flatnonzero(seen["captured"].any(axis=1))
    end = min(world.params.iterations, int(caught[0]) + 20) if len(caught) else 300
    x = np.concatenate([scene.x, seen["x"][:end]])
    y = np.concatenate([scene.y, seen["y"][:end]])
    for b in range(x.shape[1]):
        is_prey = b >= world.n_robots
        colour = PREY if is_prey else PREDATORS[b]
        ax.plot(x[:, b], y[:, b], "--" if is_prey else "-", color=colour, linewidth=1)
        ax.plot(x[0, b], y[0, b], "o", color=colour, markersize=3)
        body = {"facecolor": colour, "edgecolor": "black", "zorder": 3}
        ax.add_patch(Circle((x[-1, b], y[-1, b]), RADIUS, **body))
        heading = seen["heading"][end - 1, b]
        nose = [x[-1, b], x[-1, b] + RADIUS * math.cos(heading)]
        ax.plot(nose, [y[-1, b], y[-1, b] + RADIUS * math.sin(heading)], color="white", zorder=4)
        if is_prey:
            reach = world.params.sensor_range_cm + 2 * RADIUS
            ring = {"facecolor": "none", "edgecolor": PREY, "linestyle": ":"}
            ax.add_patch(Circle((x[-1, b], y[-1, b]), reach, **ring))
    side = world.params.arena_cm
    ax.set(xlim=(0, side), ylim=(0, side), aspect="equal", xlabel="cm")
    when = f"captured in iteration {caught[0]}" if len(caught) else "not captured"
    ax.set_title(f"Four heuristic predators; the prey is {when}", loc="left", fontsize=10)


def main():
    """Write ``pictures/arena.png``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=61, help="of the epoch")
    seed = parser.parse_args().seed
    world = conevo.world("pursuit/team-3")
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.4), layout="constrained")
    draw_sensors(axes[0], world.params)
    draw_epoch(axes[1], world, seed)
    full = io.BytesIO()
    figure.savefig(full, dpi=80)
    PICTURE.parent.mkdir(exist_ok=True)
    Image.open(full).convert("RGB").quantize(48).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
