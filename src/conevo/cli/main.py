"""The table of commands. The module of a command is loaded when it is used: help is instant."""

from __future__ import annotations

import atexit
import errno
import io
import logging
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import click

from conevo.errors import ConevoError, UsageError, is_interrupt, unknown_name

__all__ = ["cli", "main"]

VERBS = {
    "run": "Evolve a team and test it.",
    "shape-prey": "Evolve prey for the pursuit world.",
    "check": "Check a world, such as one of your own.",
    "resume": "Continue an interrupted run, or a finished one.",
    "test": "Test a run's fittest team in fresh scenarios.",
    "replay": "See a run's fittest team in the browser.",
    "film": "Make a film of a run's fittest team (GIF, MP4).",
    "watch": "Follow runs live in the browser.",
    "export": "Export a run's fittest team to a file that runs without conevo.",
    "track": "Send generations to TensorBoard, W&B or MLflow.",
    "behaviours": "Classify what robots do, each and together.",
    "signal": "Measure how well trials distinguish genotypes.",
    "campaign": "Start, monitor, stop and retry campaigns of many runs.",
    "report": "Write a campaign's report: page, tables, figures, data.",
    "query": "Query a campaign's tables with SQL.",
    "show": "Print a finished or running run.",
    "list": "List worlds, controllers, methods, presets, settings or runs.",
}
IN_A_ROW = 2.0  # seconds between two interrupts that count as one
MODULES = {"list": "listing", "shape-prey": "shape_prey"}


class Text(click.types.StringParamType):
    """A text that is not empty, since "$RUN" without such a variable is a mistake."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | Any:
        """Return the text."""
        if value == "" and param is not None:
            raise UsageError(f"{param.opts[0]} is empty: give a value, or leave it out")
        return super().convert(value, param, ctx)


def _refuse_empty(command: click.Command) -> None:
    """Let all text options of a command refuse an empty text."""
    for parameter in command.params:
        if isinstance(parameter, click.Option) and parameter.type is click.STRING:
            parameter.type = Text()
    for one in getattr(command, "commands", {}).values():
        _refuse_empty(one)


class Verbs(click.Group):
    """A group that lists its commands without loading them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands in the order of their use."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """Load a command."""
        if cmd_name not in VERBS:
            raise unknown_name("command", cmd_name, VERBS)
        module = import_module(f"conevo.cli.{MODULES.get(cmd_name, cmd_name)}")
        command: click.Command = getattr(module, MODULES.get(cmd_name, cmd_name))
        _refuse_empty(command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table without loading the commands."""
        with formatter.section("Commands"):
            formatter.write_dl(list(VERBS.items()))


class Notes(logging.Handler):
    """Prints log messages of the library, one line each."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message."""
        click.echo(f"conevo: note: {' '.join(record.getMessage().split())}", err=True)


NOTES = Notes()


def fail(message: str, code: int) -> NoReturn:
    """End with one line on stderr."""
    click.echo(f"conevo: error: {' '.join(message.split())}", err=True)
    sys.exit(code)


def print_version(ctx: click.Context, parameter: click.Parameter, is_asked: bool) -> None:
    """Print the version and end."""
    if is_asked:
        import conevo

        click.echo(f"conevo {conevo.__version__}")
        ctx.exit()


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=print_version,
    help="Show the version and exit.",
)
def cli() -> None:
    """Collective Neuro-Evolution: evolve teams of robots that specialize.

    Try: conevo run rover/complex-1
    """


def _ready_streams() -> None:
    """Make all texts printable: closed streams become null devices, other letters are escaped."""
    for name in ("stdin", "stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the parent process, as by >&-
            stream = Path(os.devnull).open("r" if name == "stdin" else "w")  # noqa: SIM115
            setattr(sys, name, stream)
        if name != "stdin" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _count_interrupts_once() -> None:
    """Count Ctrl-C as one interrupt if it is pressed several times in a row.

    A second interrupt would end the handling of the first: writing a checkpoint and the last
    message. A later one counts again. Ignored interrupts, as in background jobs of a shell, stay
    ignored.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return
    if threading.current_thread() is not threading.main_thread():
        return
    last = -math.inf

    def interrupt(*_: object) -> None:
        nonlocal last
        before, last = last, time.monotonic()
        if last - before > IN_A_ROW:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # the message has been printed


def _refuse_undecoded(word: str) -> None:
    """Raise UsageError if a word of the command line could not be decoded."""
    if not any("\ud800" <= letter <= "\udfff" for letter in word):
        return
    try:
        text = os.fsencode(word).decode("utf-8")
    except UnicodeError:
        raise UsageError(f"{word!r} is not valid UTF-8, as names and settings must be") from None
    raise UsageError(
        f"{text!a} is UTF-8, and the locale's encoding here is {sys.getfilesystemencoding()}; set "
        f"PYTHONUTF8=1"
    )


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Execute a command line; every error is one line, and has an exit code.

    2: the request cannot be carried out as written; 3: the machine refused; 130: interrupted.
    """
    _ready_streams()
    _count_interrupts_once()
    logging.getLogger("conevo").addHandler(NOTES)
    try:
        words = list(sys.argv[1:] if arguments is None else arguments)
        for word in words:
            _refuse_undecoded(word)
        with cli.make_context("conevo", words) as ctx:
            code = cli.invoke(ctx)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = 0
    except click.exceptions.Exit as error:
        code = error.exit_code
    except ConevoError as error:
        fail(str(error), error.exit_code)
    except click.ClickException as error:
        fail(error.format_message(), 2)
    except (KeyboardInterrupt, click.Abort):
        fail("interrupted", 130)
    except MemoryError:
        fail(
            "not enough memory: ask for less, as with method.genotypes, method.pairs, "
            "method.rounds, run.epochs or --scenarios",
            3,
        )
    except OSError as error:
        from conevo.cli.run_to_end import drop_output

        if error.errno == errno.EPIPE:  # the reader of our output has ended
            drop_output()
            sys.exit(0)
        if error.errno == errno.ENOSPC and not error.filename:
            drop_output()
            fail(f"standard output: {error.strerror}", 3)
        fail(f"{error.filename}: {error.strerror}" if error.filename else str(error), 3)
    except (Exception, SystemExit) as error:
        if isinstance(error, Exception) and is_interrupt(error):  # no exit after its message
            fail("interrupted", 130)
        outside = sys.modules.get("conevo.outside")
        line = outside.line_of(error) if outside else ""
        if not line:
            raise
        fail(line, 2)
    sys.exit(code if isinstance(code, int) else 0)
