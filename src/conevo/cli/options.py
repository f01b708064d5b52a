"""Options of the commands that start runs, and the actions that they ask for."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.run_to_end import all_of, carry_on, style_of, threads_option, time_limit_option
from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig
    from conevo.runs.run import Run
    from conevo.runs.shaping import Shaping
    from conevo.runs.time_limit import TimeLimit

__all__ = ["Order", "setting_options", "settings_only"]

PLACE = "on the command line"
settings_only = all_of(
    click.option(
        "--method", metavar="NAME",
        help="cone (default), mesp, ccga, hetcne, homcne, cone-1..3, cone-es, hom-es, esp, "
        "sane, cosyne, neat, hyperneat, openai-es, cma-es, novelty, map-elites, hyb-ccea, or "
        "FILE.py:NAME.",
    ),
    click.option(
        "--preset", metavar="NAME", help="smoke (seconds), desk (minutes, default), night, thesis."
    ),
    click.option("--seed", type=int,
        help="Root of all randomness (default: 1)."),
    click.option(
        "--set", "settings", metavar="KEY=VALUE", multiple=True,
        help="One setting, for example run.generations=5; may be repeated.",
    ),
    click.option(
        "--config", metavar="FILE", help="TOML file with settings, such as a run's config.toml."
    ),
)  # fmt: skip
"""Settings of a run, for a command that starts none."""
setting_options = all_of(
    settings_only,
    click.option(
        "--budget-evaluations", type=int,
        help="Spend at most this many team evaluations."
    ),
    threads_option,
    click.option(
        "--device", default="cpu", show_default=True,
        help="cpu, cuda or auto (cuda if there is one); does not change results.",
    ),
    click.option("--out", metavar="DIR", help="Output directory (default: a new one under runs/)."),
    time_limit_option,
)  # fmt: skip
"""Settings of a run, and where to execute it."""


@dataclass
class Order:
    """The options of a command line; fields have the options' names.

    Raises:
        UsageError: options that are mutually exclusive, an unknown device, or a tracker that cannot
            be used.
    """

    method: str | None
    preset: str | None
    seed: int | None
    settings: tuple[str, ...]
    config: str | None
    budget_evaluations: int | None = None
    threads: int | None = None
    device: str = "cpu"
    out: str | None = None
    limit: TimeLimit | None = None
    as_json: bool = False
    quiet: bool = False
    verbose: bool = False
    comparing: bool = False
    track: str | None = None

    def __post_init__(self) -> None:
        from conevo.kernels.devices import refuse_unknown_device
        from conevo.runs.assignments import parse_assignments

        refuse_unknown_device(self.device)
        if self.track is not None:
            from conevo.track.trackers import kind_named

            kind_named(self.track).refuse()
        self.style = style_of(self.as_json, self.quiet, self.verbose)
        self.overrides = parse_assignments(self.settings)
        names = (("method", self.method), ("preset", self.preset), ("seed", self.seed))
        for name, value in names:
            self._refuse_twice(f"run.{name}", f"--{name}", value)
        self.take("run.budget_evaluations", "--budget-evaluations", self.budget_evaluations)

    def take(self, key: str, option: str, value: Any) -> None:
        """Add an option to the settings, if it is given.

        Raises:
            UsageError: --set gives the same setting.
        """
        self._refuse_twice(key, option, value)
        if value is not None:
            self.overrides[key] = value

    def _refuse_twice(self, key: str, option: str, value: Any) -> None:
        given = {key, key.partition(".")[2]} & set(self.overrides)
        if value is not None and given:
            raise UsageError(
                f"{option} and --set {given.pop()} are mutually exclusive: give one of them"
            )

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods of --method, "cone" by default.

        Raises:
            UsageError: several methods without --seeds.
        """
        found = tuple(dict.fromkeys((self.method or "cone").split(",")))
        if len(found) > 1 and not self.comparing:
            raise UsageError(
                f"--method {self.method}: several methods need --seeds N, for example 3"
            )
        return found

    def resolve(self, world: str | None) -> RunConfig:
        """Return the configuration for a world, or for the world of --config.

        With several methods, it has the first one.
        """
        from conevo.runs.config import resolve

        self._refuse_twice("run.world", "WORLD/ENVIRONMENT", world)
        return resolve(
            world,
            self.methods[0] if self.method else None,
            self.preset,
            self.seed,
            file=self.config,
            overrides=self.overrides,
            place=PLACE,
        )

    def print_only(
        self, configs: Sequence[RunConfig], origin: str | None = None, of_champion: bool = False
    ) -> None:
        """Print the settings and costs of a run, or of every stage; writes and starts nothing.

        Args:
            configs: of the run, or of every stage.
            origin, of_champion: as for ``start``.
        """
        from conevo.cli.lookup import find_last
        from conevo.cli.settings_text import print_dry_run
        from conevo.runs.directory import refuse_existing
        from conevo.runs.run import RUNS
        from conevo.runs.shaping import label, stand_ins
        from conevo.runs.start import beginning

        if len(configs) == 1:
            found = None if origin is None else find_last(origin)
            path, ancestor, ancestry = beginning(configs[0], self.out, found, of_champion)
            ancestors = [ancestor]
        else:
            path, ancestry = Path(self.out or RUNS / label(configs)), {}
            ancestors = [*stand_ins(configs)]
            refuse_existing(path)
        print_dry_run(configs, path, self.as_json, ancestors, ancestry)

    def resolve_both(self, world: str | None, first: str) -> list[RunConfig]:
        """Return the configurations of two stages; method ``first`` evolves the first one.

        Settings of the method apply to the second stage. ``first_share`` may be among the settings.
        """
        from conevo.runs.first import FIRST, SHARE, resolve_stages, without_method

        if self.config is not None:
            raise UsageError("--first and --config are mutually exclusive; use --set for settings")
        share = self.overrides.pop(SHARE, None)
        config = self.resolve(world)
        return resolve_stages(
            [config.address],
            config.method_entry.address,
            self.preset,
            self.seed,
            self.overrides | {FIRST: first} | ({} if share is None else {SHARE: share}),
            without_method(self.overrides, config.method_entry.config_class),
            PLACE,
        )

    def start(
        self, configs: Sequence[RunConfig], origin: str | None = None, of_champion: bool = False
    ) -> None:
        """Start a run, or a shaping if there are several stages, and continue it to its end.

        Args:
            configs: of the run, or of every stage.
            origin: name of another run that has the initial populations; of a shaping, its last
                stage has them.
            of_champion: breed the populations from the champion of ``origin`` instead.
        """
        from conevo.cli.lookup import find_last
        from conevo.runs.shaping import start_stages
        from conevo.runs.start import start

        how: dict[str, Any] = {"threads": self.threads, "device": self.device}
        how["command"] = shlex.join(["conevo", *sys.argv[1:]])
        begun: Run | Shaping
        if len(configs) > 1:
            begun = start_stages(configs, self.out, **how)
        else:
            found = None if origin is None else find_last(origin)
            begun = start(configs[0], self.out, origin=found, of_champion=of_champion, **how)
        self.start_tracker(begun.path)
        carry_on(begun, self.threads, self.style, self.limit)

    def start_tracker(self, path: Path) -> None:
        """Start the tracker of --track, if it is given, for a new run, shaping or campaign."""
        if self.track is None:
            return
        from conevo.track.spawning import spawn
        from conevo.track.trackers import kind_named

        line = spawn(path, kind_named(self.track))
        if self.style != "quiet":
            click.echo(f"conevo: note: {line}", err=True)
