"""What shows a stream or a recording, and may ask something of it; and who does what was asked for."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from plumbob.core.errors import ParameterError, PlumbobError, one_line
from plumbob.viewer.messages import Batch, Command, Hello


class Asked(NamedTuple):
    """A command, and who gave it."""

    client: Any
    command: Command


class Outlet(Protocol):
    """What shows a stream: the pipe to a server, or a terminal. None of its methods waits."""

    def hello(self, hello: Hello) -> None:
        """Begin, or begin again with other columns."""

    def batch(self, batch: Batch) -> None:
        """Show more samples, and the newest of everything."""

    def event(self, t: float | None, kind: str, text: str) -> None:
        """Show an event."""

    def reset(self) -> None:
        """Forget what was shown: time begins again."""

    def answer(self, request: Asked, ok: bool, text: str) -> None:
        """Answer a command."""

    def take_commands(self) -> Sequence[Asked]:
        """Commands since the last call."""

    @property
    def ready(self) -> bool:
        """Whether it can take more without dropping any."""


class Desk:
    """Does what an outlet asks for, a verb each.

    Parameters
    ----------
    outlet : Outlet
        Who asks, and gets the answers.
    other : str
        What a verb that is not known here is for.

    Attributes
    ----------
    verbs : mapping of str to callable
        What does them; each gives its answer.
    """

    verbs: Mapping[str, Callable[[Command], str]]

    def __init__(self, outlet: Outlet, other: str) -> None:
        self._outlet, self._other = outlet, other

    def serve(self) -> None:
        """Do everything that was asked for since the last call, and answer."""
        for request in self._outlet.take_commands():
            try:
                self._outlet.answer(request, True, self._do(request.command))
            except (PlumbobError, OSError) as error:
                self._outlet.answer(request, False, one_line(error))

    def _do(self, command: Command) -> str:
        if command.verb not in self.verbs:
            raise ParameterError(f"'{command.verb}' is {self._other}.")
        return self.verbs[command.verb](command)
