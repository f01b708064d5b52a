"""Worker processes, which load and play a task: both ends of the pipe.

A worker reads a function with its arguments, calls it, and writes its result or its error, until
there is nothing more to read. It ends with the process that started it, also in a step of a task
that never returns. Workers have an interpreter of their own, so that a script needs no guard
against being run again by them. They are started when they are needed, and kept.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from conevo.errors import ConevoError, EnvironmentFailure, UsageError, in_a_line

__all__ = ["LOCK", "Worker", "ask_all", "workers"]

LIMITED = ("OMP", "OPENBLAS", "MKL", "NUMEXPR")  # libraries, to one thread in each worker
LOCK = threading.RLock()  # an epoch needs the workers for itself
_started: list[Worker] = []


class Worker:
    """A process that calls functions.

    Raises:
        EnvironmentFailure: it cannot be started.
    """

    def __init__(self) -> None:
        path = os.pathsep.join(place or os.getcwd() for place in sys.path)  # the same modules
        own = {f"{name}_NUM_THREADS": "1" for name in LIMITED} | {"PYTHONPATH": path}
        own |= {"PYGAME_HIDE_SUPPORT_PROMPT": "1", "SDL_VIDEODRIVER": "dummy"}
        self._owner = os.getpid()
        self._pipe, other = Pipe()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__, str(other.fileno()), str(self._owner)],
                pass_fds=[other.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # tasks may print
                stderr=subprocess.DEVNULL,
                env=os.environ | own,
            )
        except OSError as error:
            raise EnvironmentFailure(f"a worker process cannot be started: {error}") from error
        finally:
            other.close()

    @property
    def is_alive(self) -> bool:
        """Whether this process can ask it."""
        return self._owner == os.getpid() and self._process.poll() is None

    def ask(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Let it call a function of a module."""
        self._pipe.send((function, arguments))

    def answer(self) -> Any:
        """Return the function's result or error."""
        return self._pipe.recv()

    def end(self) -> int:
        """End the process and return its exit code."""
        self._process.kill()
        self._pipe.close()
        return self._process.wait()


def workers(n: int) -> list[Worker]:
    """Return n worker processes, those that there are and new ones."""
    _started[:] = [one for one in _started if one.is_alive]
    while len(_started) < n:
        _started.append(Worker())
    return _started[:n]


def ask_all(
    task: str, function: Callable[..., Any], of: Sequence[tuple[Worker, tuple[Any, ...]]]
) -> list[Any]:
    """Return the results of a function that workers call at the same time.

    Args:
        task: name of the task that they play, for errors.
        function: of a module.
        of: workers, each with its arguments.

    Raises:
        ConevoError: raised in a worker.
        UsageError: another error was raised in a worker.
        EnvironmentFailure: a worker has died.
    """
    answers = []
    asked = of[0][0]
    try:
        with LOCK:
            for asked, arguments in of:
                asked.ask(function, *arguments)
            for asked, _ in of:
                answers.append(asked.answer())
    except (EOFError, OSError) as error:
        codes = {worker: worker.end() for worker, _ in of}
        raise EnvironmentFailure(
            f"a worker process that plays {task} has died (exit code {codes[asked]})"
        ) from error
    except BaseException:  # ctrl-c: their answers belong to no question any more
        for worker, _ in of:
            worker.end()
        raise
    for answer in answers:
        if isinstance(answer, ConevoError):
            raise answer
        if isinstance(answer, Exception):
            raise UsageError(f"{task} fails: {answer}")
    return answers


def serve(pipe: Connection) -> None:
    """Call functions until there is nothing more to read."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl-c is for the process that started it
    warnings.simplefilter("ignore")
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = function(*arguments)
        except ConevoError as error:
            answer = type(error)(str(error))
        except (Exception, SystemExit, KeyboardInterrupt) as error:
            answer = Exception(in_a_line(error))
        pipe.send(answer)


def _end_after(owner: int) -> None:
    """End this process when the one that started it has ended, whatever a task does."""
    while os.getppid() == owner:
        time.sleep(0.5)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_after, args=[int(sys.argv[2])], daemon=True).start()
    serve(Connection(int(sys.argv[1])))
