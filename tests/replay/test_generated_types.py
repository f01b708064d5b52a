"""The viewer's types of a playback are those of the schema, and its constants those of films."""

import runpy
from pathlib import Path

import pytest

VIEWER = Path(__file__).resolve().parents[2] / "viewer"


@pytest.fixture
def made():
    return runpy.run_path(str(VIEWER / "make_playback.py"))


def test_they_equal_the_output_of_the_script(made):
    assert (VIEWER / "replay" / "playback.ts").read_text("utf-8") == made["text"]()


def test_a_playback_is_translated_field_by_field(made):
    found = made["text"]()
    for line in (
        '  readonly shape: "rect" | "disc" | "raster";',
        "  readonly bounds: readonly [number, number, number, number];",
        "  readonly facts: readonly (readonly [string, string])[];",
        "  readonly heading: Channel | null;",
        "export const LEAST_BODY = 3.5;",
        'export const GROUND = "#fbfaf7";',
    ):
        assert f"\n{line}\n" in found
