"""The catalogue: formats of known devices, one TOML file each."""

from plumbob.errors import ParameterError
from plumbob.sensors.format import Format
from plumbob.sensors.format_toml import formats_in


def names() -> tuple[str, ...]:
    """Names of all devices, without aliases."""
    return tuple(sorted({form.name for form in formats_in(__name__).values()}))


def load(name: str) -> Format:
    """Look a device up by its name or an alias.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in formats_in(__name__):
        raise ParameterError(
            f"'{name}' is no known device; known are {', '.join(names())}. A format of one's own is a .toml file."
        )
    return formats_in(__name__)[name]
