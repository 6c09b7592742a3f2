"""Signals of the system or a terminal that end a program whole."""

import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, Protocol


class Stoppable(Protocol):
    """What can be asked to end."""

    def set(self) -> None:
        """Ask it."""


@contextmanager
def on_signals(handler: Callable[..., object], *names: str, only_default: bool = False) -> Iterator[None]:
    """Handle signals of a system or a terminal that ends, as far as there are and none that is ignored, as by nohup.

    With `only_default` none either that somebody else handles already, as a program that calls this one.
    """
    ours = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in names if ours and hasattr(signal, name)]
    free = [each for each in numbers if signal.getsignal(each) not in (signal.SIG_IGN, None)]
    default = signal.SIG_DFL, signal.default_int_handler
    free = [each for each in free if not only_default or signal.getsignal(each) in default]
    before = {each: signal.signal(each, handler) for each in free}
    try:
        yield
    finally:
        for each, handler_before in before.items():
            signal.signal(each, handler_before)


@contextmanager
def held_signals() -> Iterator[None]:
    """Let them wait while a process is started, which would be nobody's if they came before it has a name."""
    waiting: list[int] = []
    try:
        with on_signals(lambda number, _: waiting.append(number), "SIGTERM", "SIGINT", "SIGHUP"):
            yield
    finally:
        for number in waiting:
            signal.raise_signal(number)


def stopped_by_signals(stop: Stoppable) -> AbstractContextManager[None]:
    """Let SIGTERM, Ctrl-C and the loss of the terminal set it: ending is how a live line is used, no mishap."""
    return on_signals(lambda *_: stop.set(), "SIGTERM", "SIGINT", "SIGHUP")


def end_process(process: "subprocess.Popen[Any]", ending: float, asking: float) -> None:
    """Wait `ending`, s, for a process to end, ask it to and wait `asking`, s, and then kill it."""
    for ask, patience in ((process.poll, ending), (process.terminate, asking), (process.kill, None)):
        ask()
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return
