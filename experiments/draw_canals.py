"""Draw the ten canal layouts on one sheet: ``python experiments/draw_canals.py``."""

import io
from pathlib import Path

import matplotlib
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from conevo.worlds.rover.canals import N_LAYOUTS, load

PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "canals.png"


def main() -> None:
    """Write ``pictures/canals.png``: two rows of five, origin bottom left."""
    figure, axes = plt.subplots(2, 5, figsize=(12.5, 5.4), layout="constrained")
    for environment, ax in zip(range(1, N_LAYOUTS + 1), axes.flat, strict=True):
        mask = load(environment)
        ax.imshow(mask, cmap="Reds", vmin=0, vmax=1.3, origin="lower", extent=(0, 1, 0, 1))
        ax.set_title(f"environment {environment}: {int(mask.sum())} sites", fontsize=9)
        ax.set_xticks([0, 1])
        ax.set_yticks([0, 1])
    full = io.BytesIO()
    figure.savefig(full, dpi=80)
    PICTURE.parent.mkdir(exist_ok=True)
    Image.open(full).convert("RGB").quantize(16).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
