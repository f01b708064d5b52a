"""The configuration files of other readings: their contents, and worlds that use them."""

from pathlib import Path

import pytest

from conevo.runs.config import resolve
from conevo.worlds.gacc.world import GaccParams
from conevo.worlds.rover.world import RoverParams

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_gathering_as_the_tables_describe_it():
    config = resolve("gacc/complex-2", preset="thesis", file=EXAMPLES / "gacc-as-tables.toml")
    assert config.run.credit == "team"
    assert config.world_params == GaccParams(
        needs_detection=True,
        home_side=0.3,
        object_range=0.126,
        robot_range=0.126,
        grip_distance=0.02,
    )
    assert len(config.build_world().scenarios([1, 2])) == 2  # obstacles and objects have room


def test_rovers_whose_energy_binds():
    """A rover that always detects with med or hi runs out of energy before the epoch ends."""
    config = resolve("rover/complex-5", preset="thesis", file=EXAMPLES / "rover-energy-binds.toml")
    p = config.world_params
    assert p == RoverParams(low_cost=0.25, med_cost=0.5, hi_cost=1.0)
    lives = [p.energy / (cost + p.rover_sensor_cost) for cost in p.cost]
    assert lives == pytest.approx([3333, 1818, 952], abs=1)
    assert [life < p.iterations for life in lives] == [False, True, True]


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.toml")), ids=lambda file: file.name)
def test_the_command_in_a_file_is_that_of_the_file(file):
    text = file.read_text(encoding="utf-8")
    assert f"--config examples/{file.name}" in text
    assert f"`{file.name}`" in (EXAMPLES / "README.md").read_text(encoding="utf-8")
