"""The catalogue: formats of known devices, one TOML file each."""

from functools import cache
from importlib import resources

from plumbob.errors import ParameterError
from plumbob.sensors.format import Format
from plumbob.sensors.format_toml import parse_format


def names() -> tuple[str, ...]:
    """Names of all devices, without aliases."""
    return tuple(sorted({form.name for form in _index().values()}))


def load(name: str) -> Format:
    """Look a device up by its name or an alias.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in _index():
        raise ParameterError(
            f"'{name}' is no known device; known are {', '.join(names())}. A format of one's own is a .toml file."
        )
    return _index()[name]


@cache
def _index() -> dict[str, Format]:
    folder = resources.files("plumbob.sensors.catalog")
    found = [parse_format(file.read_text(encoding="utf-8")) for file in folder.iterdir() if file.name.endswith(".toml")]
    return {name: form for form in found for name in (form.name, *form.aliases)}
