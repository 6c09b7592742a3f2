"""Frames of the emulated rigs' microcontrollers, one TOML file each."""

from plumbob.errors import ParameterError
from plumbob.sensors.format import Format
from plumbob.sensors.format_toml import formats_in


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
        raise ParameterError(f"'{name}' is no rig; known are {', '.join(names())}.")
    return formats_in(__name__)[name]
