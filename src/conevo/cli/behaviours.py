"""``conevo behaviours``: what the predators of a run's fittest team do."""

from __future__ import annotations

import json
from typing import Any

import click

__all__ = ["behaviours"]


@click.command(short_help="Classify predators: pursuer, blocker, flanker, knocker, idle.")
@click.argument("run")
@click.option(
    "--scenarios",
    type=click.IntRange(1, 10_000),
    default=20,
    show_default=True,
    help="Number of scenarios.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    help="Seed of other scenarios (default: those of the run's own test).",
)
@click.option(
    "--threads",
    type=click.IntRange(1, 4096),
    help="CPU threads (default: all); does not change results.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def behaviours(
    run: str, scenarios: int, seed: int | None, threads: int | None, as_json: bool
) -> None:
    """Classify what the fittest team of RUN does in fresh scenarios; nothing is written.

    RUN must be a run of the pursuit world.

    Try: conevo behaviours runs/hunt
    """
    from conevo.analysis.behaviour_report import behaviour_report
    from conevo.cli.find import find_run

    found = behaviour_report(find_run(run), scenarios, seed, threads=threads)
    click.echo(json.dumps(found) if as_json else _text(found))


def _text(found: dict[str, Any]) -> str:
    from conevo.cli.text import castes, number, table
    from conevo.terms import S_SCALE, counted

    def two(values: Any) -> list[str]:
        return [f"{v:.2f}" if isinstance(v, float) else str(v) for v in values]

    lives = found["predators"]
    names, columns = list(lives[0]["shares"]), ("reproduced", "primitive", "left", "right")
    seen = {name: n for name, n in found["captures"].items() if n}
    return "\n".join([
        f"{found['run']}: fittest team (generation {found['generation']}), "
        f"{counted(found['scenarios'], 'fresh scenario')}, "
        f"capture time {number(found['capture_time'])}",
        f"\nShares of the windows in which a predator interacts or idles (S: {S_SCALE})",
        table(["", *names, "S", "label"], [
            [f"predator {k}", *two(one["shares"].values()), number(one["specialization"]),
             one["label"]] for k, one in enumerate(lives)]),
        f"\nCaptures: {castes(seen) or 'none'}; most frequent: {found['collective']}",
        "\nAverages of the sensors, from the front counter-clockwise",
        table(["", "", *map(str, range(8))], [
            [row["behaviour"], kind, *two(row[kind])]
            for row in found["sensors"] for kind in ("proximity", "light")]),
        "\nWith the sensors held at a predator's own averages (portion of trials)",
        table(["", "behaviour", *columns, "result"], [
            [f"predator {row['predator']}", row["behaviour"], *two(row[c] for c in columns),
             row["result"]] for row in found["reproduction"]]),
    ])  # fmt: skip
