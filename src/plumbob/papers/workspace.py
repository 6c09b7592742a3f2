"""What every paper's run works with: its folder, its seed, progress, and rigs whose real bytes are recorded."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from plumbob.core.errors import DecodeError
from plumbob.core.files import write_text
from plumbob.core.time import to_ns
from plumbob.data.recording import Recording
from plumbob.files import write
from plumbob.live.emulated import emulate
from plumbob.live.record import record
from plumbob.live.rigs.rig import columns_for
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format
from plumbob.simulation import Simulation

_SESSION = """\
kind = "plumbob session"
version = 1

[source]
kind = "file"
path = "{name}.bin"

[format]
name = "{rig}"
{more}"""


class Taken(NamedTuple):
    """Files of a rig that was emulated and recorded.

    `recording`: what its session recorded of its bytes, for `plumbob.read`, `plumbob.replay` and every verb; `truth`:
    what the simulator put into the frames, with the true attitude, for several units that of the first one, beside
    which those of the others are named after the units; `capture`, `session`: the bytes, and the session that says what
    they mean.
    """

    recording: Path
    truth: Path
    capture: Path
    session: Path


@dataclass
class Work:
    """What a paper's run works with.

    `folder`: where its files go; it exists; `seed`: of everything that is left to chance; `progress`: called with what
    is being done, how many steps are done, and of how many.
    """

    folder: Path
    seed: int = 1
    progress: Callable[[str, int, int], None] = lambda what, done, of: None

    def steps(self, count: int) -> Callable[[str], None]:
        """Call what this gives with what is being done, before each of so many steps."""
        done = iter(range(count))
        return lambda what: self.progress(what, next(done), count)

    def seeds(self, count: int) -> range:
        """Seeds of so many runs beside the one through bytes; those of another work are others."""
        return range(1000 * self.seed, 1000 * self.seed + count)

    def recorded(self, rig: str, name: str, *, session: str = "", text: Path | None = None, **how: Any) -> Taken:
        """Emulate a rig, whose name is that of its format, and record its bytes by a session, as a user would.

        `name`: of the files; `session`: what goes on in the session's table ``[format]``, and its further tables, as
        TOML; `text`: where the session's outward line goes; `how`: as of `plumbob.emulate`, with the seed of the work
        where none is given.
        """
        files = self._files(name)
        emulate(rig, **{"seed": self.seed, **how}, write=files.capture, truth=files.truth, overwrite=True)
        return self._record(rig, name, session, text)

    def sent(self, rig: str, name: str, said: Simulation, *, session: str = "", text: Path | None = None) -> Taken:
        """Send the samples of a simulation of your own in the frames of a rig of one unit, and record the bytes.

        Values are rounded and cut as the frame's fields do; otherwise as `recorded`.
        """
        files, form = self._files(name), find_format(rig).bind()
        t_ns = to_ns(said.imu.t)
        files.capture.write_bytes(
            encode(form, columns_for(form.messages[0], {"": said}, t_ns, np.arange(t_ns.size))).tobytes()
        )
        write(files.truth, Recording(imu=said.imu, track=said.truth, name=name), overwrite=True)
        return self._record(rig, name, session, text)

    def _files(self, name: str) -> Taken:
        return Taken(*(self.folder / f"{name}{end}" for end in (".mcap", ".truth.parquet", ".bin", ".session.toml")))

    def _record(self, rig: str, name: str, session: str, text: Path | None = None) -> Taken:
        """Record the bytes that lie in the folder by a session."""
        files = self._files(name)
        write_text(files.session, _SESSION.format(name=name, rig=rig, more=session), overwrite=True)
        files.recording.unlink(missing_ok=True)  # a recording is never written over
        notes: list[str] = []
        done = record(files.session, out=files.recording, text=text, note=notes.append)
        if done.lossy:  # a figure of what is left would be wrong without a word
            raise DecodeError(f"{files.recording} was not recorded completely: {'; '.join(notes)}.")
        return files
