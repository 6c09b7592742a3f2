"""Commands: what may be asked of a view, read from what a client sent and believed nothing; who asks, and who does it.

`plumbob control` is a client: what the buttons of the live page do, from a script or another shell.
"""

import json
import math
import re
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple, Protocol, cast
from urllib.parse import parse_qs, urlsplit

from plumbob.core.errors import DecodeError, LineError, ParameterError, PlumbobError, one_line, unknown_name
from plumbob.viewer.messages import Batch, Command, Hello, Verb

LONGEST_NAME: Final = 64  # Letters of a name at most
LONGEST_TEXT: Final = 200  # Letters of a text at most

VERBS: Final[dict[str, tuple[str, str]]] = {
    "record": ("", "name"), "stop": ("", ""), "mark": ("text", ""), "tare": ("", ""), "untare": ("", ""),
    "text": ("", "name"), "text-stop": ("", ""), "add": ("name", ""), "remove": ("name", ""), "play": ("", ""),
    "pause": ("", ""), "seek": ("value", ""), "speed": ("value", ""), "calibrate": ("name", "text"),
    "calibrate-end": ("", ""), "calibrate-cancel": ("", ""), "allan-reset": ("", ""),
}  # fmt: skip
"""What each verb needs, and what it may have: a name, a text or a value."""
_NAME: Final = re.compile(rf"[A-Za-z0-9_-][A-Za-z0-9_.-]{{0,{LONGEST_NAME - 1}}}")
_LARGEST: Final = 2**53


class RefusedError(ParameterError):
    """A command that is not one."""

    def __init__(self, text: str, number: int = 0) -> None:
        self.id = number
        super().__init__(text)


def parse_command(data: str | bytes) -> Command:
    """Command that a JSON object says."""
    content = _object(data)
    number = content.get("id")
    if type(number) is not int or not 0 <= number < _LARGEST:
        raise RefusedError("A command needs an id, a whole number from 0 to 2⁵³ − 1.")
    try:
        return _command(number, content)
    except ParameterError as error:
        raise RefusedError(str(error), number) from None


def _object(data: str | bytes) -> dict[str, Any]:
    try:
        content = json.loads(data, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        raise RefusedError('A command must be a JSON object, as {"id": 1, "verb": "stop"}; this is not JSON.') from None
    if not isinstance(content, dict):
        raise RefusedError('A command must be a JSON object, as {"id": 1, "verb": "stop"}.')
    return content


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _command(number: int, content: dict[str, Any]) -> Command:
    if unknown := sorted(content.keys() - {"id", "verb", "name", "text", "value"}):
        raise ParameterError(f"A command has no '{unknown[0][:20]}'; it has id, verb, name, text and value.")
    verb = content.get("verb")
    if not isinstance(verb, str) or verb not in VERBS:
        raise ParameterError(f"The verb must be one of {', '.join(VERBS)}.")
    name, text = content.get("name", ""), checked_text(content.get("text", ""))
    command = Command(
        id=number,
        verb=cast(Verb, verb),
        name=name if name == "" else checked_name(name),
        text=text,
        value=_value(content),
    )
    needed, allowed = VERBS[verb]
    given = {"name": command.name != "", "text": command.text != "", "value": command.value is not None}
    for key, is_given in given.items():
        if key == needed and not is_given:
            raise ParameterError(f"'{verb}' needs a {key}.")
        if is_given and key not in (needed, allowed):
            raise ParameterError(f"'{verb}' takes no {key}. Leave it out.")
    return command


def checked_name(name: Any) -> str:
    """Name of an output or of an estimator, as somebody gave it."""
    if not isinstance(name, str) or _NAME.fullmatch(name) is None:
        raise ParameterError(
            f"A name may have at most {LONGEST_NAME} letters, digits, '-', '_' and '.', not '.' first; it is "
            "never a path."
        )
    return name


def checked_text(text: Any) -> str:
    """Text of a mark, as somebody gave it."""
    if not isinstance(text, str) or len(text) > LONGEST_TEXT or not text.isprintable():
        raise ParameterError(f"A text may have at most {LONGEST_TEXT} printable characters, all on one line.")
    return text


def _value(content: dict[str, Any]) -> float | None:
    value = content.get("value")
    if value is None:
        return None
    if type(value) not in (int, float) or not abs(value) < _LARGEST or not math.isfinite(value):
        raise ParameterError("A value must be a finite number.")
    return float(value)


class ClientCommand(NamedTuple):
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

    def answer(self, request: ClientCommand, ok: bool, text: str) -> None:
        """Answer a command."""

    def take_commands(self) -> Sequence[ClientCommand]:
        """Commands since the last call."""

    @property
    def ready(self) -> bool:
        """Whether it can take more without dropping any."""


class CommandHandler:
    """Does what an outlet asks for, a verb each; `other` says what a verb that is not known here is for."""

    def __init__(self, outlet: Outlet, other: str, verbs: Mapping[str, Callable[[Command], str]]) -> None:
        self._outlet, self._other, self._verbs = outlet, other, verbs

    def serve(self) -> None:
        """Do everything that was asked for since the last call, and answer."""
        for request in self._outlet.take_commands():
            try:
                command = request.command
                if command.verb not in self._verbs:
                    raise ParameterError(f"'{command.verb}' is {self._other}.")
                self._outlet.answer(request, True, self._verbs[command.verb](command))
            except (PlumbobError, OSError) as error:
                self._outlet.answer(request, False, one_line(error))


_TOKEN: Final = "token"
_PATIENCE: Final = 15.0
_MOST: Final = 1 << 16


def control(url: str, what: str, argument: str | float | None = None) -> str:
    """Ask a live view for something, as a button of its page does.

    record [NAME], stop, mark TEXT, tare, untare, text [NAME], text-stop, add NAME, remove NAME; of a recording that is
    played: play, pause, seek SECONDS, speed FACTOR; calibrate KIND, calibrate-end, calibrate-cancel, allan-reset.

    Parameters
    ----------
    url : str
        Its address with the token, as `plumbob view` prints it.
    what : str
        What to do.
    argument : str or float, optional
        What it needs: a name, the text of a mark, a position, s, or a speed.

    Returns
    -------
    str
        What the view answers.

    Raises
    ------
    ParameterError
        If the verb is not known, or the view refuses it.
    LineError
        If there is no view at the address, or it does not accept the token.
    DecodeError
        If what answers is not a view.
    """
    answer = _posted(*_place(url), {"id": 1, "verb": what, **verb_value(what, argument)})
    if not isinstance(answer.get("ok"), bool) or not isinstance(answer.get("text"), str):
        raise DecodeError(f"what answers at {urlsplit(url).netloc} is not a view of this version of Plumbob.")
    if not answer["ok"]:
        raise ParameterError(f"the view refused: {answer['text']}")
    reply: str = answer["text"]
    return reply


def verb_value(verb: str, argument: str | float | None) -> dict[str, Any]:
    """What a verb's argument is to the view, by name."""
    if verb not in VERBS:
        raise unknown_name("command", verb, VERBS, of="the view")
    if argument is None:
        return {}
    needed, allowed = VERBS[verb]
    kind = needed or allowed
    if not kind:
        raise ParameterError(f"'{verb}' takes no argument, but got '{argument}'.")
    if kind != "value":
        return {kind: str(argument)}
    try:
        value = float(argument)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"'{verb}' needs a number, but got '{argument}'.")
    return {kind: value}


def _place(url: str) -> tuple[str, str]:
    """Address without the token, and the token."""
    try:
        parts = urlsplit(url)
        is_address = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:  # brackets that do not close, or a port that is not a number
        is_address = False
    tokens = parse_qs(parts.query).get(_TOKEN, []) if is_address else []
    if len(tokens) != 1:
        raise ParameterError(
            "the address must be as plumbob view prints it, http://127.0.0.1:8770/?token=..., in quotation marks where "
            "a shell reads it."
        )
    return f"{parts.scheme}://{parts.netloc}", tokens[0]


def _posted(place: str, token: str, command: dict[str, Any]) -> dict[str, Any]:
    request = urllib.request.Request(
        f"{place}/api/command",
        data=json.dumps(command).encode(),
        headers={"Authorization": f"Bearer {token}", "Content-Type": "application/json"},
        method="POST",
    )
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), _NoRedirect)  # never through a proxy
    try:
        with opener.open(request, timeout=_PATIENCE) as reply:
            return _reply(reply.read(_MOST), place)
    except urllib.error.HTTPError as error:
        with error:
            return _status_error(error, place)
    except OSError as error:
        reason = getattr(error, "reason", error)
        raise LineError(f"no view answers at {place}: {getattr(reason, 'strerror', None) or reason}.") from error


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any) -> None:
        """Never take the token elsewhere."""
        return


def _status_error(error: urllib.error.HTTPError, place: str) -> dict[str, Any]:
    """What a status says, where it is not an answer."""
    if error.code == 401:
        raise LineError(f"the view at {place} does not accept the token; take the address that it printed.")
    try:
        return _reply(error.read(_MOST), place)
    except DecodeError:
        raise LineError(f"the view at {place} answers with status {error.code} ({error.reason}).") from error


def _reply(data: bytes, place: str) -> dict[str, Any]:
    try:
        content = json.loads(data)
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise DecodeError(f"what answers at {place} is not a view of Plumbob.")
    return content
