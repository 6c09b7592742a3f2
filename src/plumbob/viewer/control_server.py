"""Commands in the server: what is a matter of the view is done here, what is one of the session goes over the pipe."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import asdict
from itertools import count
from typing import Any, Final

from plumbob.core.errors import PlumbobError, one_line
from plumbob.viewer.hub import Hub
from plumbob.viewer.messages import Answer, Command
from plumbob.viewer.pipe import PipeMessage

PATIENCE: Final = 10.0
"""How long an answer of the session is waited for, s."""


class Control:
    """Does commands.

    Parameters
    ----------
    hub : Hub
        What the server knows; it lets each command that was done be known as an event.
    write : callable
        Writes a message into the pipe, and says whether it was taken.
    """

    def __init__(self, hub: Hub, write: Callable[[PipeMessage], bool]) -> None:
        self._hub, self._write = hub, write
        self._numbers = count(1)
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self.here: dict[str, Callable[[Command], str | Awaitable[str]]] = {"tare": self._tare, "untare": self._untare}
        hub.listeners.add(self._listen)

    async def do(self, command: Command) -> Answer:
        """Do a command, and say how it went."""
        answer = await (self._do_here(command) if command.verb in self.here else self._ask(command))
        if answer.ok:
            self._hub.tell("command", f"{_accepted(command)}: {answer.text}" if answer.text else _accepted(command))
        return answer

    async def _do_here(self, command: Command) -> Answer:
        try:
            reply = self.here[command.verb](command)
            return Answer(id=command.id, ok=True, text=reply if isinstance(reply, str) else await reply)
        except PlumbobError as why:
            return Answer(id=command.id, ok=False, text=one_line(why))

    async def _ask(self, command: Command) -> Answer:
        """Ask the session, which knows the command by a number of ours: two clients may use the same."""
        number = next(self._numbers)
        if not self._write(PipeMessage("command", {"client": number, **asdict(command)})):
            return Answer(id=command.id, ok=False, text="The session takes no command at present. Try again.")
        future = self._asked[number] = asyncio.get_running_loop().create_future()
        try:
            answer = await asyncio.wait_for(future, PATIENCE)
        except TimeoutError:
            return Answer(id=command.id, ok=False, text=f"The session has not answered within {PATIENCE:.0f} s.")
        finally:
            del self._asked[number]
        return Answer(id=command.id, ok=bool(answer["ok"]), text=str(answer["text"]))

    def _listen(self, message: PipeMessage) -> None:
        if message.kind != "answer":
            return
        future = self._asked.get(message.content["client"])
        if future is not None and not future.done():
            future.set_result(message.content)

    def _tare(self, _command: Command) -> str:
        attitude = self._hub.fields.get("attitudes", {}).get(self._hub.primary)
        if attitude is None:
            raise PlumbobError("There is no attitude to count from yet. Wait for one.")
        self._hub.tare.set(attitude["q_nb"])
        return "Roll, pitch and yaw count from this attitude; charts, errors and recordings do not."

    def _untare(self, _command: Command) -> str:
        self._hub.tare.clear()
        return "Roll, pitch and yaw count from the navigation frame."


def _accepted(command: Command) -> str:
    """What an event says of a command that was done."""
    arguments = " ".join(str(part) for part in (command.name, command.text, command.value) if part not in ("", None))
    return f"{command.verb} {arguments}".strip()
