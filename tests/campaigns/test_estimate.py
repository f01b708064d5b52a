import json

import pytest
import tomli_w

from campaigns.plans import tiny_campaign
from conevo.campaigns.ledger import Entry
from conevo.campaigns.progress import remaining_seconds
from watch.followed import record, tables


@pytest.fixture
def campaign(tmp_path):
    return tiny_campaign(tmp_path)


def entries_of(campaign, *states):
    """Return entries: (state, core seconds, when it began)."""
    return {
        label: Entry(label, state, 1, "", 1, began, seconds)
        for label, (state, seconds, began) in zip(campaign.planned, states, strict=True)
    }


PENDING = ("pending", 0.0, None)


def test_no_estimate_without_any_progress(campaign):
    assert remaining_seconds(campaign, entries_of(campaign, *[PENDING] * 4), 2, 100.0) is None


def test_runs_cost_what_those_of_their_cell_did(campaign):
    # homcne seed 1, cone seed 1, homcne seed 2, cone seed 2
    known = entries_of(campaign, ("finished", 10.0, 0.0), ("finished", 30.0, 0.0), PENDING, PENDING)
    assert remaining_seconds(campaign, known, 2, 100.0) == pytest.approx((10 + 30) / 2)


def test_a_cell_without_a_finished_run_costs_what_its_world_did(campaign):
    known = entries_of(campaign, ("finished", 10.0, 0.0), PENDING, PENDING, PENDING)
    assert remaining_seconds(campaign, known, 1, 100.0) == pytest.approx(30)


def test_the_elapsed_time_of_a_running_run_is_subtracted(campaign):
    known = entries_of(
        campaign, ("finished", 10.0, 0.0), ("running", 0.0, 94.0), PENDING, ("failed", 0.0, 0.0)
    )
    assert remaining_seconds(campaign, known, 1, 100.0) == pytest.approx((10 - 6) + 10)


def test_until_a_run_is_finished_the_progress_of_running_ones_counts(campaign):
    first = next(iter(campaign.planned))
    log = campaign.paths.run(first) / "generations.jsonl"
    log.parent.mkdir(parents=True)
    (log.parent / "config.toml").write_text(tomli_w.dumps(tables(generations=2)))
    log.write_text(json.dumps(record(0)) + '\n{"team_eval')  # one of two generations, one torn
    known = entries_of(campaign, ("running", 0.0, 90.0), PENDING, PENDING, PENDING)
    assert remaining_seconds(campaign, known, 1, 100.0) == pytest.approx(10 + 3 * 20)


def test_nothing_is_left_of_a_finished_campaign(campaign):
    known = entries_of(campaign, *[("finished", 1.0, 0.0)] * 3, ("failed", 0.0, 0.0))
    assert remaining_seconds(campaign, known, 2, 100.0) == 0.0
