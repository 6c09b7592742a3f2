"""Files: `read` and `write` choose the format by the suffix; `FORMATS` lists what there is."""

from typing import TYPE_CHECKING

from plumbob.core import lazily

if TYPE_CHECKING:
    from plumbob.files.foreign.opensim import write_orientations
    from plumbob.files.formats import FORMATS, FileFormat, is_known_log, is_recording, kind_of, read, write
    from plumbob.files.numbers import Numbers, open_numbers
    from plumbob.files.profile import Profile, load_profile, parse_profile

__getattr__, __dir__ = lazily(
    __name__,
    {
        "FORMATS": "formats",
        "FileFormat": "formats",
        "Numbers": "numbers",
        "Profile": "profile",
        "is_known_log": "formats",
        "is_recording": "formats",
        "kind_of": "formats",
        "load_profile": "profile",
        "open_numbers": "numbers",
        "parse_profile": "profile",
        "read": "formats",
        "write": "formats",
        "write_orientations": "foreign.opensim",
    },
)

__all__ = [
    "FORMATS",
    "FileFormat",
    "Numbers",
    "Profile",
    "is_known_log",
    "is_recording",
    "kind_of",
    "load_profile",
    "open_numbers",
    "parse_profile",
    "read",
    "write",
    "write_orientations",
]
