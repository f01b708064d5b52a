"""The versions of the code that may continue a campaign: the first, and those accepted since.

``code.json`` in the campaign's directory lists them, so that workers on all machines refuse to
continue with another conevo: else different code might make the runs of one comparison, unnoticed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable

from typing_extensions import TypedDict

from conevo.campaigns.paths import Paths
from conevo.errors import UsageError
from conevo.reading import read_json
from conevo.runs.code import current_code, last_code
from conevo.runs.durable import replace_file
from conevo.terms import quoted

__all__ = ["admit_code"]


class Codes(TypedDict):
    """``code.json``: the versions, each with its code, that may continue a campaign."""

    codes: list[str]


def admit_code(paths: Paths, labels: Iterable[str], accept: bool = False) -> None:
    """Let this version of conevo continue a campaign.

    Args:
        paths: of the campaign.
        labels: of its runs; while none of them has begun, the first code is admitted.
        accept: admit it although others have begun the campaign.

    Raises:
        UsageError: other code has begun it, and this one is not accepted; or ``code.json`` is
            damaged.
        EnvironmentFailure: it cannot be written.
    """
    here = current_code()
    codes = read_json(paths.code, Codes)["codes"] if paths.code.is_file() else []
    if here in codes:
        return
    if not codes:  # not begun, or by conevo 0.1.0
        runs = [paths.run(label) for label in labels]
        files = [file for run in runs for file in run.glob("**/provenance.json")]
        codes = sorted({last_code(read_json(file)) for file in files} - {here})
    if codes and not accept:
        raise UsageError(
            f"{paths.root} was started by conevo {', '.join(codes)}, and this is {here}, which may "
            f"give other results: use that version, or continue with 'conevo campaign start "
            f"{quoted(paths.root)} --accept-other-code'"
        )
    replace_file(paths.code, json.dumps({"codes": [*codes, here]}, indent=1).encode() + b"\n")
