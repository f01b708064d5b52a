"""The numpy archive of a team: ``about`` and the arrays of weights.

``about`` is JSON in bytes, the facts of ``EvolvedTeam``. The other arrays are the weights, float32,
whose names and shapes depend on the kind of controller (docs/export.md).
"""

from __future__ import annotations

import io
import json

import numpy as np

from conevo.export.team import EvolvedTeam

__all__ = ["to_npz"]


def to_npz(team: EvolvedTeam) -> bytes:
    """Return the content of an ``.npz`` file."""
    about = np.frombuffer(json.dumps(team.about).encode(), np.uint8)
    file = io.BytesIO()
    np.savez_compressed(file, about=about, **team.network.weights)  # type: ignore[arg-type]
    return file.getvalue()
