"""`plumbob control`, the client's side: what the buttons of the live page do, from a script or another shell."""

import json
import math
import urllib.error
import urllib.request
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from plumbob.core.errors import DecodeError, LineError, ParameterError
from plumbob.viewer.commands import VERBS

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
        raise DecodeError(f"what answers at {_bare(url)} is not a view of this version of Plumbob.")
    if not answer["ok"]:
        raise ParameterError(f"the view refuses: {answer['text']}")
    reply: str = answer["text"]
    return reply


def verb_value(verb: str, argument: str | float | None) -> dict[str, Any]:
    """What a verb's argument is to the view, by name.

    Raises
    ------
    ParameterError
        If the verb is not known, takes none, or needs a number.
    """
    _require_known(verb)
    if argument is None:
        return {}
    needed, allowed = VERBS[verb]
    kind = needed or allowed
    if not kind:
        raise ParameterError(f"'{verb}' takes nothing behind it, but got '{argument}'.")
    if kind != "value":
        return {kind: str(argument)}
    try:
        value = float(argument)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"'{verb}' needs a number, but got '{argument}'.")
    return {kind: value}


def _require_known(verb: str) -> None:
    if verb not in VERBS:
        raise ParameterError(f"the view knows no verb '{verb}'; there are {', '.join(VERBS)}.")


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


def _bare(url: str) -> str:
    """Address as it may be shown: without its token."""
    return urlsplit(url).netloc


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
            return _object(reply.read(_MOST), place)
    except urllib.error.HTTPError as error:
        with error:
            return _refused(error, place)
    except OSError as error:
        reason = getattr(error, "reason", error)
        raise LineError(f"no view answers at {place}: {getattr(reason, 'strerror', None) or reason}.") from error


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any) -> None:
        """Never take the token elsewhere."""
        return


def _refused(error: urllib.error.HTTPError, place: str) -> dict[str, Any]:
    """What a status says, where it is not an answer."""
    if error.code == 401:
        raise LineError(f"the view at {place} does not accept the token; take the address that it printed.")
    try:
        return _object(error.read(_MOST), place)
    except DecodeError:
        raise LineError(f"the view at {place} answers with status {error.code} ({error.reason}).") from error


def _object(data: bytes, place: str) -> dict[str, Any]:
    try:
        content = json.loads(data)
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise DecodeError(f"what answers at {place} is not a view of Plumbob.")
    return content
