"""One door to every format: a file of your own, a catalogued device, or a rig."""

from pathlib import Path

from plumbob.core import check
from plumbob.core.errors import ParameterError
from plumbob.protocols import catalog, rigs
from plumbob.protocols.format import Format
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
