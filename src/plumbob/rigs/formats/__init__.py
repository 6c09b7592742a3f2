"""Frames of the emulated rigs' microcontrollers, one TOML file each."""

from functools import cache
from importlib import resources

from plumbob.errors import ParameterError
from plumbob.sensors.format import Format
from plumbob.sensors.format_toml import parse_format


def names() -> tuple[str, ...]:
    """Names of all rigs."""
    return tuple(sorted(_index()))


def load(name: str) -> Format:
    """Frame of a rig, by its name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in _index():
        raise ParameterError(f"'{name}' is no rig; known are {', '.join(names())}.")
    return _index()[name]


@cache
def _index() -> dict[str, Format]:
    folder = resources.files("plumbob.rigs.formats")
    found = [parse_format(file.read_text(encoding="utf-8")) for file in folder.iterdir() if file.name.endswith(".toml")]
    return {form.name: form for form in found}
