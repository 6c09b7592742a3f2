"""The catalogue: formats of known devices, one TOML file each."""

from plumbob.protocols.format_toml import device as load
from plumbob.protocols.format_toml import device_names as names

__all__ = ["load", "names"]
