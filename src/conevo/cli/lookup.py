"""Find the run, shaping or campaign that a name or a path selects."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from conevo.errors import UsageError, unknown_name, without_team
from conevo.runs.directory import CAMPAIGN, UNREADABLE, kind_of, kinds_in
from conevo.runs.durable import is_there
from conevo.runs.run import RUNS, Run
from conevo.runs.shaping import Shaping
from conevo.terms import quoted

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = [
    "campaign_at",
    "directories",
    "find",
    "find_campaign",
    "find_last",
    "find_run",
    "only_campaign",
    "open_directory",
    "sealed",
]


def find(text: str) -> Run | Shaping:
    """Return the run or shaping at a path, or the only one in runs/ with this beginning of a name.

    Raises:
        UsageError: no such run or shaping, or more than one.
    """
    if Path(text).exists():
        return open_directory(Path(text))
    names = {path.name: path for path in directories(RUNS, "run", "shaping")}
    matches = [name for name in names if name.startswith(text.removeprefix(f"{RUNS}/"))]
    if len(matches) == 1:
        return open_directory(names[matches[0]])
    if matches:
        raise UsageError(f"{text!r} is ambiguous; it matches: {', '.join(matches)}")
    raise unknown_name("run", text, names, f"in {RUNS}/")


def find_run(text: str) -> Run:
    """Return a run by name or path; of a shaping, its last stage that has a team.

    Raises:
        UsageError: no such run, more than one, or no stage that has begun.
    """
    found = find(text)
    if isinstance(found, Run):
        return found
    stages = [stage for stage in found.stages if stage.champion is not None]
    if not stages:
        raise without_team(found.path, found.generations())
    return stages[-1]


def find_last(text: str) -> Run:
    """Return a run by name or path; of a shaping, its last stage.

    Raises:
        UsageError: no such run, more than one, or the shaping is not finished.
    """
    found = find(text)
    if isinstance(found, Run):
        return found
    if found.status != "finished":
        raise UsageError(
            f"{found.path} is not finished, so no run can begin with its populations; "
            f"finish it with 'conevo resume {quoted(found.path)}'"
        )
    return found.stages[-1]


def directories(folder: Path, *kinds: str) -> list[Path]:
    """Return the directories of these kinds in ``folder``, sorted by name.

    Those that may not be read are among them: one may be of any kind.
    """
    wanted = (*kinds, UNREADABLE)
    return [path for path, kind in kinds_in(folder).items() if kind in wanted]


def campaign_at(text: str) -> Campaign | None:
    """Return the campaign at a path, or of this name in campaigns/; None if there is none."""
    from conevo.campaigns.campaign import CAMPAIGNS, Campaign

    for path in (Path(text), CAMPAIGNS / text):
        if is_there(path / CAMPAIGN):
            return Campaign(path)
    return None


def find_campaign(text: str) -> Campaign:
    """Return a campaign by path, or by its name in campaigns/.

    Raises:
        UsageError: no such campaign.
    """
    from conevo.campaigns.campaign import CAMPAIGNS

    found = campaign_at(text)
    if found is None and kind_of(Path(text)) in ("run", "shaping"):
        raise UsageError(
            f"{text} is a {kind_of(Path(text))}; see it with 'conevo show {quoted(text)}'"
        )
    if found is None:
        known = [path.name for path in directories(CAMPAIGNS, "campaign")]
        raise unknown_name("campaign", text, known, f"in {CAMPAIGNS}/")
    return found


def only_campaign() -> Campaign:
    """Return the only campaign in campaigns/.

    Raises:
        UsageError: none, or more than one.
    """
    from conevo.campaigns.campaign import CAMPAIGNS, Campaign

    paths = directories(CAMPAIGNS, "campaign")
    if len(paths) == 1:
        return Campaign(paths[0])
    names = ", ".join(path.name for path in paths)
    raise UsageError(
        f"which campaign? Name one of: {names}" if paths else f"no campaigns in {CAMPAIGNS}/ yet"
    )


@contextmanager
def sealed(campaign: Campaign) -> Iterator[Path]:
    """Yield the folder with the tables of all finished runs.

    Raises:
        UsageError: no run is finished yet.
        EnvironmentFailure: the tables cannot be written anywhere.
    """
    from conevo.campaigns.sealing import sealed_tables

    with sealed_tables(campaign) as folder:
        if not (folder / "runs.parquet").is_file():
            raise UsageError(
                f"{campaign.path} has no finished run yet, so there is nothing to show"
            )
        yield folder


def open_directory(path: Path) -> Run | Shaping:
    """Return the run or shaping in a directory.

    Raises:
        UsageError: neither is there, or it is damaged.
    """
    if kind_of(path) == "campaign":
        raise UsageError(
            f"{path} is a campaign; see its runs with "
            f"'conevo campaign status {quoted(path)} --runs'"
        )
    return Shaping(path) if kind_of(path) == "shaping" else Run(path)
