"""One door to every format: a file of your own, a catalogued device, or a rig."""

from pathlib import Path

from plumbob.core import check
from plumbob.core.errors import ParameterError
from plumbob.protocols import catalog, rigs
from plumbob.protocols.format import Format, Message
from plumbob.protocols.format_toml import load_format


def find_format(name: str | Path) -> Format:
    """Format that a name means.

    Parameters
    ----------
    name : str or path
        A ``.toml`` file, a device of the catalogue or one of its aliases, or a rig.

    Raises
    ------
    DecodeError
        If the file cannot be read, or is not a format.
    ParameterError
        If there is neither.
    """
    name = str(check.path("name", name))
    if name.endswith(".toml"):
        return load_format(Path(name))
    if name in rigs.names():
        return rigs.load(name)
    try:
        return catalog.load(name)
    except ParameterError as error:
        raise ParameterError(f"{error} Rigs are {', '.join(rigs.names())}.") from error


def unassigned_told(form: Format, message: Message) -> str | None:
    """Which bytes of a message the user's own format leaves out; of a known device they are known to be spare."""
    from plumbob.protocols.overlap import unassigned

    if form.name in {*catalog.names(), *rigs.names()} or not (places := unassigned(form, message)):
        return None
    spans = ", ".join(str(at) if end == at + 1 else f"{at} to {end - 1}" for at, end in places)
    return f"no field of message {message.name} uses its bytes {spans} of {message.length}; they are ignored"
