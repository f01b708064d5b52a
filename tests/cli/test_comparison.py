"""Several methods and seeds without a plan file: ``conevo run --seeds``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conevo.campaigns.campaign import Campaign
from runs.tiny import TASK, tiny_settings

SETTINGS = [word for key, value in tiny_settings("homcne").items()
            for word in ("--set", f"{key}={value}")]  # fmt: skip
TINY = ["run", TASK, "--preset", "smoke", *SETTINGS, "--set", "run.generations=1"][:-2]


def test_methods_are_compared_with_every_seed_and_more_seeds_extend_it(say, tmp_path) -> None:
    words = [*TINY, "--method", "mesp,homcne", "--threads", "1", "--quiet"]
    done = say(*words, "--seeds", "1")
    assert (done.code, done.err) == (0, "")
    campaign = Campaign(done.out.strip())
    assert [(one.method, one.seed) for one in campaign.planned.values()] == [
        ("mesp", 1),
        ("homcne", 1),
    ]
    assert campaign.path.parent == Path("campaigns")
    assert all(campaign.is_finished(label) for label in campaign.planned)
    options = [word for word in words if word != "--quiet"]
    more = say(*options, "--seeds", "2", "--dry-run", "--json")
    assert [json.loads(line)["run"][-2:] for line in more.out.splitlines()] == ["s1"] * 2 + [
        "s2"
    ] * 2
    again = say(*words, "--seeds", "2")
    assert (again.code, again.out) == (0, done.out)
    assert len(Campaign(done.out.strip()).planned) == 4


def test_seeds_count_from_the_given_one(say, tmp_path: Path) -> None:
    said = say(*TINY, "--seeds", "2", "--seed", "7", "--dry-run", "--json")
    assert [json.loads(line)["run"] for line in said.out.splitlines()] == [
        "rover-v2-complex-1-cone-s7",
        "rover-v2-complex-1-cone-s8",
    ]
    assert list(tmp_path.iterdir()) == []


def test_a_setting_may_be_given_without_its_section(say) -> None:
    words = ["run", TASK, "--preset", "smoke", "--method", "cone,mesp", "--seeds", "1", "--dry-run"]
    short, full = (say(*words, "--set", f"{key}=2") for key in ("generations", "run.generations"))
    assert (short.code, short.out) == (0, full.out)
    both = say(*words, "--set", "generations=2", "--set", "run.generations=3")
    assert (both.code, "is given as generations, too" in both.err) == (2, True)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--method", "mesp,homcne"], "several methods need --seeds N"),
        (["--method", "mesp,homcn", "--seeds", "2"], "did you mean 'homcne'"),
        (["--method", "mesp,", "--seeds", "2"], "unknown method ''"),
        (["--seeds", "0"], "0 is not in the range"),
        (["--seeds", "1000000000"], "is not in the range"),
        (["--seeds", "2", "--config", "x.toml"], "cannot read x.toml"),
    ],
)
def test_an_impossible_comparison_is_one_line(more, words, say, tmp_path: Path) -> None:
    said = say(*TINY, *more)
    assert said.code in (2, 3)
    assert words in said.err
    assert said.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
