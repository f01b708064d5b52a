"""A run while it evolves: a progress bar in a notebook, a line per generation elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from conevo.numbers import duration, number
from conevo.runs.html import STYLE, escape
from conevo.runs.progress import Pace
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["in_notebook", "showing"]

PAUSE = 0.25  # seconds between two updates of a bar


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None


@contextmanager
def showing(
    run: Run, progress: bool | None, watch: Callable[[Run, Record], None] | None
) -> Iterator[Callable[[Record], None]]:
    """Yield the function that is called with the record of each finished generation.

    Args:
        run: the run that is resumed.
        progress: None: a bar in a notebook, nothing elsewhere; True: a printed line per generation
            elsewhere; False: nothing.
        watch: also called.
    """
    is_bar = progress is not False and in_notebook()
    bar = _Bar(run) if is_bar else None

    def show(record: Record) -> None:
        if bar is not None:
            bar.add(record)
        elif progress:
            _print_line(run, record)
        if watch is not None:
            watch(run, record)

    try:
        yield show
    finally:
        if bar is not None:
            bar.end()


def _print_line(run: Run, record: Record) -> None:
    done, planned = record["generation"] + 1, run.outline.generations
    print(f"generation {done}/{planned}  {_value(record)}", flush=True)  # noqa: T201 (asked for)


def _value(record: Record) -> str:
    """Return the name and value of the main measure."""
    name, value = next(iter(record["performance"].items()))
    return f"{name} {number(value)}"


class _Bar:
    """A bar that IPython displays and updates in place."""

    def __init__(self, run: Run) -> None:
        from IPython.display import display

        self.run, self.pace, self.shown_at = run, Pace(run), time.monotonic()
        self.handle = display(self._bundle("starts"), raw=True, display_id=True)

    def add(self, record: Record) -> None:
        """Show a finished generation, unless the last update is too recent."""
        self.pace.add(record)
        is_last = self.pace.done.generations == self.pace.outline.generations
        if is_last or time.monotonic() >= self.shown_at + PAUSE:
            self.shown_at = time.monotonic()
            self._show("testing" if is_last else f"{duration(self.pace.seconds_left)} left")

    def end(self) -> None:
        """Show the finished run, or how to continue it."""
        is_finished = self.run.status == "finished"
        again = f"conevo.Run({str(self.run.path)!r}).resume() continues it"
        self._show("finished" if is_finished else again, 1.0 if is_finished else None)

    def _show(self, state: str, share: float | None = None) -> None:
        self.handle.update(self._bundle(state, share), raw=True)

    def _bundle(self, state: str, share: float | None = None) -> dict[str, str]:
        """Return the bar as HTML, and its content as text."""
        records, planned = self.pace.records, self.pace.outline.generations
        value = [_value(records[-1])] if records else []
        text = " · ".join(
            [f"generation {len(records)} of {planned}", *value, state, str(self.run.path)]
        )
        over = self.pace.share if share is None else share
        bar = f'<progress value="{over:.4f}" max="1"></progress> {escape(text)}'
        return {"text/plain": text, "text/html": f'{STYLE}<div class="conevo">{bar}</div>'}
