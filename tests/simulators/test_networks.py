"""Many robots' controllers at once act as each one alone, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.controllers.registry import CONTROLLERS, controller
from conevo.rng import stream
from conevo.simulators import networks
from conevo.simulators.networks import Networks

OTHERS = ({}, {"n_hidden": 3, "max_hidden": 7}, {"recurrent": False}, {"bias": True})
CASES = [(name, {}) for name in CONTROLLERS] + [("srn", settings) for settings in OTHERS[1:]]


@pytest.mark.parametrize(("name", "settings"), CASES)
@pytest.mark.parametrize("block", [2048, 3])
def test_outputs_are_those_of_forward(
    name: str, settings: dict[str, object], block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(networks, "BLOCK", block)
    mind = controller(name, **settings)
    b, r, s, o = 5, 2, 4, 3
    genome, rng = mind.genome(s, o), stream(1, "networks")
    genes = rng.uniform(-1, 1, (30, genome.n_genes)).astype(np.float32)
    teams = rng.integers(30, size=(b, r, genome.max_parts)).astype(np.int32)
    teams[rng.random(teams.shape) < 0.5] = -1
    teams[0], teams[:, :, -2:] = -1, -1  # a team of empty controllers; slots that nobody fills
    many = Networks(mind, genes, teams, o)
    rows = teams.reshape(b * r, -1)
    memory = np.zeros((*rows.shape, mind.n_memory), np.float32)
    for _ in range(6):
        inputs = rng.normal(size=(b, r, s)).astype(np.float32)
        alone, memory = mind.forward(genes[rows], rows >= 0, memory, inputs.reshape(-1, s), o)
        assert many.think(inputs).tobytes() == alone.tobytes()
        assert many.hidden.reshape(b * r, -1).tobytes() == memory[:, :, 0].tobytes()
    assert np.ptp(alone, axis=0).all()
