"""Commands: what may be asked for; `parse_command` reads one from what a client sent, and believes it nothing."""

import json
import math
import re
from typing import Any, Final, cast

from plumbob.core.errors import ParameterError
from plumbob.viewer.messages import Command, Verb

LONGEST_NAME: Final = 64
"""Letters of a name at most."""
LONGEST_TEXT: Final = 200
"""Letters of a text at most."""

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
    """A command that is not one.

    Attributes
    ----------
    id : int
        That of the command, where it has one; else 0.
    """

    def __init__(self, text: str, number: int = 0) -> None:
        self.id = number
        super().__init__(text)


def parse_command(data: str | bytes) -> Command:
    """Command that a JSON object says.

    Raises
    ------
    RefusedError
        If it is not one: another key, type, length or verb, or a number that is not finite.
    """
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
        raise RefusedError('A command is a JSON object, as {"id": 1, "verb": "stop"}; this is not JSON.') from None
    if not isinstance(content, dict):
        raise RefusedError('A command is a JSON object, as {"id": 1, "verb": "stop"}.')
    return content


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _command(number: int, content: dict[str, Any]) -> Command:
    if unknown := sorted(content.keys() - {"id", "verb", "name", "text", "value"}):
        raise ParameterError(f"A command has no '{unknown[0][:20]}'; it has id, verb, name, text and value.")
    verb = content.get("verb")
    if not isinstance(verb, str) or verb not in VERBS:
        raise ParameterError(f"The verb must be one of {', '.join(VERBS)}.")
    name, text = _name(content.get("name", "")), checked_text(content.get("text", ""))
    command = Command(id=number, verb=cast(Verb, verb), name=name, text=text, value=_value(content))
    needed, allowed = VERBS[verb]
    given = {"name": command.name != "", "text": command.text != "", "value": command.value is not None}
    for key, is_given in given.items():
        if key == needed and not is_given:
            raise ParameterError(f"'{verb}' needs a {key}.")
        if is_given and key not in (needed, allowed):
            raise ParameterError(f"'{verb}' takes no {key}. Leave it out.")
    return command


def _name(name: Any) -> str:
    return "" if name == "" else checked_name(name)


def checked_name(name: Any) -> str:
    """Name of an output or of an estimator, as somebody gave it.

    Raises
    ------
    ParameterError
        If it could be a path, or is too long.
    """
    if not isinstance(name, str) or _NAME.fullmatch(name) is None:
        raise ParameterError(
            f"A name has at most {LONGEST_NAME} letters, digits, '-', '_' and '.', and does not begin with '.'; it is "
            "never a path."
        )
    return name


def checked_text(text: Any) -> str:
    """Text of a mark, as somebody gave it.

    Raises
    ------
    ParameterError
        If it is too long, or has more than one line.
    """
    if not isinstance(text, str) or len(text) > LONGEST_TEXT or not text.isprintable():
        raise ParameterError(f"A text has at most {LONGEST_TEXT} printable letters, all in one line.")
    return text


def _value(content: dict[str, Any]) -> float | None:
    value = content.get("value")
    if value is None:
        return None
    if type(value) not in (int, float) or not abs(value) < _LARGEST or not math.isfinite(value):
        raise ParameterError("A value is a finite number.")
    return float(value)
