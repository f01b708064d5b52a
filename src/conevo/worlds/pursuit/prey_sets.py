"""Evolved prey as data: the networks of one prey and of two, with the command that made them.

Nitschke 2009, section 4.3: the fittest controllers of shaping experiments 3 (one prey) and 6 (two
prey) are the opponents of the pursuit-evasion experiments. A prey set is one npz file.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import EnvironmentFailure, UsageError
from conevo.reading import packed, parse_json, read_arrays

__all__ = ["PreySet", "load", "save"]

FORMAT = "conevo prey set 1"
SHIPPED = "prey-v2.npz"  # evolved in prey-v2
MOST_BYTES = 2**24  # of a file, packed and unpacked
N_GENES = 10  # eight sensors, two wheels (fig. 4.2)
WEIGHT_SCALE = 10.0  # weight of gene 1 (table 4.3)


@dataclass(frozen=True)
class PreySet:
    """Neuron genotypes of prey controllers, in [-1, 1].

    Attributes:
        one: [1, U, G] float32, the prey that evolved alone.
        one_active: [1, U] bool, whether a slot contains a neuron.
        two: [2, U, G] float32, the two that evolved together.
        two_active: [2, U] bool.
        about: the command, seed and versions that made them.
    """

    one: npt.NDArray[np.float32]
    one_active: npt.NDArray[np.bool_]
    two: npt.NDArray[np.float32]
    two_active: npt.NDArray[np.bool_]
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Twelve hex digits that identify the networks, whatever command made them."""
        found = hashlib.blake2b(digest_size=6)
        for array in (self.one, self.one_active, self.two, self.two_active):
            found.update(f"{array.dtype.str} {array.shape}".encode())
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()

    def weights(
        self, n_prey: int, scale: float
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return input weights [Q * U, 8] and output weights [Q * U, 2]; empty slots are zero.

        Args:
            n_prey: Q, one or two.
            scale: weight of gene 1.
        """
        genes, active = (self.one, self.one_active) if n_prey == 1 else (self.two, self.two_active)
        scaled = np.where(active[..., None], genes, 0) * np.float32(scale)
        flat = scaled.reshape(-1, N_GENES).astype(np.float32)
        return flat[:, :8].copy(), flat[:, 8:].copy()


def save(path: Path, prey: PreySet) -> None:
    """Write a prey set; the same set always gives the same bytes.

    Raises:
        EnvironmentFailure: the file cannot be written.
    """
    about = json.dumps({"format": FORMAT} | prey.about, sort_keys=True)
    names = ("one", "one_active", "two", "two_active")
    content = packed(about, {name: getattr(prey, name) for name in names})
    try:
        path.write_bytes(content)
    except OSError as error:
        raise EnvironmentFailure(f"cannot write {path}: {error.strerror}") from error


def load(path: str | Path | None = None) -> PreySet:
    """Return a prey set, by default the shipped one.

    Raises:
        UsageError: the file is missing, damaged or not a prey set.
        EnvironmentFailure: it cannot be read.
    """
    arrays = _read(path)
    try:
        about = parse_json(arrays.pop("about").tobytes(), "about")
        if about.pop("format") != FORMAT:
            raise ValueError("another format")
        prey = PreySet(**arrays, about=about)
        for n, genes, active in ((1, prey.one, prey.one_active), (2, prey.two, prey.two_active)):
            if genes.shape != (n, *active.shape[1:], N_GENES) or active.shape[0] != n:
                raise ValueError(f"wrong shape {genes.shape}")
            if genes.dtype != np.float32 or active.dtype != np.bool_ or not active.any(1).all():
                raise ValueError("wrong content")
            if not (np.abs(genes) <= 1).all():
                raise ValueError("genes outside [-1, 1]")
    except Exception as error:  # a damaged file may make its readers raise anything
        raise UsageError(f"{path} is damaged or not a prey set ({error})") from error
    return prey


def _read(path: str | Path | None) -> dict[str, npt.NDArray[Any]]:
    if path is None:
        with resources.as_file(resources.files(__package__) / SHIPPED) as shipped:
            return read_arrays(shipped)
    return read_arrays(Path(path), MOST_BYTES, "a prey set")
