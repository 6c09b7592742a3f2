"""Frames of the emulated rigs' microcontrollers, one TOML file each."""

from plumbob.core.errors import ParameterError
from plumbob.protocols.format import Format
from plumbob.protocols.format_toml import formats_in


def names() -> tuple[str, ...]:
    """Names of all rigs."""
    return tuple(sorted(formats_in(__name__)))


def load(name: str) -> Format:
    """Frame of a rig, by its name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in formats_in(__name__):
        raise ParameterError(f"'{name}' is not a rig; known are {', '.join(names())}.")
    return formats_in(__name__)[name]
