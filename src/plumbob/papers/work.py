"""What every paper's run works with: its folder, its seed, progress, and rigs whose real bytes are recorded."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from plumbob.core.files import write_text
from plumbob.session.emulated import emulate
from plumbob.session.live import record

_SESSION = """\
kind = "plumbob session"
version = 1

[source]
kind = "file"
path = "{name}.bin"

[format]
name = "{rig}"
{more}"""


def _nowhere(_what: str, _done: int, _of: int) -> None:
    pass


class Taken(NamedTuple):
    """Files of a rig that was emulated and recorded.

    Attributes
    ----------
    recording : Path
        What its session recorded of its bytes, for `plumbob.read`, `plumbob.replay` and every verb.
    truth : Path
        What the simulator put into the frames, with the true attitude; for several units, their first one's folder
        mates are named after the units.
    capture, session : Path
        The bytes, and the session that says what they mean.
    """

    recording: Path
    truth: Path
    capture: Path
    session: Path


@dataclass(frozen=True, slots=True)
class Work:
    """What a paper's run works with.

    Attributes
    ----------
    folder : Path
        Where its files go; it exists.
    seed : int
        Of everything that is left to chance.
    progress : callable
        Called with what is being done, how many steps are done, and of how many.
    """

    folder: Path
    seed: int = 1
    progress: Callable[[str, int, int], None] = field(default=_nowhere)

    def recorded(self, rig: str, name: str, *, session: str = "", **how: Any) -> Taken:
        """Emulate a rig, and record its bytes by a session, as a user would.

        Parameters
        ----------
        rig : str
            Its name, which is that of its format.
        name : str
            Of the files.
        session : str
            What goes on in the session's table ``[format]``, and its further tables, as TOML.
        **how
            As of `plumbob.emulate`; the seed is that of the work where none is given.
        """
        files = Taken(*(self.folder / f"{name}{end}" for end in (".mcap", ".truth.parquet", ".bin", ".session.toml")))
        emulate(rig, **{"seed": self.seed, **how}, write=files.capture, truth=files.truth, overwrite=True)
        write_text(files.session, _SESSION.format(name=name, rig=rig, more=session), overwrite=True)
        files.recording.unlink(missing_ok=True)  # a recording is never written over
        record(files.session, out=files.recording)
        return files
