"""Kill every verb that writes, at random moments and on a disk that fills: is a file ever torn, or an old one lost?

A server imports everything and runs each verb once; every trial is a fork of it, so that a signal meets the work and
not the imports. Half of the moments are drawn over the whole of the work, half while a file is being written. In every
other trial an old file stands where the new one goes. Afterwards the file must be absent or as it was before, or be
whole, which its reader decides; and no temporary is left but by SIGKILL, which the next run removes.

A disk that fills is a file system in memory, where a user may mount one (`unshare -rm`); otherwise the limit of the
size of a file. Recordings of a live line have benchmarks of their own (recorder_kill.py, recorder_damage.py).

    python -m benchmarks.interrupted [--trials 20] [--verbs convert,run] [--json]
"""

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from plumbob import files
from plumbob.cli.main import main as plumbob
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.files.mcap import verify
from plumbob.live.recorded import read_recorded

SIGNALS = {"SIGKILL": signal.SIGKILL, "SIGTERM": signal.SIGTERM, "SIGINT": signal.SIGINT}
DONE = (0, 3)
"""Exit codes of work that was done; 3 is that of a repair whose recording lacks rows."""
STOPPED = {
    "SIGKILL": {-signal.SIGKILL},
    "SIGTERM": {128 + signal.SIGTERM, -signal.SIGTERM},  # the latter before the verb began; a shell sees one number
    "SIGINT": {128 + signal.SIGINT},
    "full disk": {1},
}
"""Exit codes of work that was not."""
OLD = b"what was there before\n"
FRAME = 31
"""Bytes of a frame of the buoy."""
DISK_BYTES = 64 << 20
CLEANED = 3
"""So many times, a verb runs once more after a kill, and must remove what that left."""
LONGEST = 120.0
"""A child that does not end within so many seconds hangs."""


# --- what is written, and what reads it -------------------------------------------------------------------------


def _page(path: Path) -> None:
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")


def _png(path: Path) -> None:
    assert path.read_bytes().endswith(b"IEND\xaeB`\x82")


def _rows(count: int) -> Callable[[Path], None]:
    """A text of so many lines."""

    def read(path: Path) -> None:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        assert len(lines) == count
        assert lines[-1].endswith("\n")

    return read


def _bytes(count: int) -> Callable[[Path], None]:
    """So many bytes."""

    def read(path: Path) -> None:
        assert path.stat().st_size == count

    return read


def _parquet(path: Path) -> None:
    import pyarrow.parquet as pq

    assert pq.read_table(path).num_rows


def _mcap(path: Path) -> None:
    assert verify(path).whole
    assert read_recorded(path, estimated=True).name


def _table(path: Path) -> None:
    """A table, or its profile, which is nothing alone."""
    table = path.with_name(path.name.replace(".profile.toml", ".csv"))
    if table.exists() and table.read_bytes() != OLD:
        assert files.read(table).name


def _json(path: Path) -> None:
    json.loads(path.read_text(encoding="utf-8"))


class Case(NamedTuple):
    """A command line, what it reads, and its outputs with their readers."""

    words: str
    outputs: dict[str, Callable[[Path], object]]


def cases(inputs: Path) -> dict[str, Case]:
    """By name; `{}` stands for the folder of inputs."""
    frames = len((inputs / "buoy.bin").read_bytes()) // FRAME
    return {
        "sim": Case(
            "sim buoy --frame NED --duration 120s --out a.parquet --card card.json --noise-card noise.json "
            "--sensors mpu6000+hmc5983 --unit random",
            {"a.parquet": files.read, "card.json": CalibrationCard.load, "noise.json": NoiseCard.load},
        ),
        "sim .csv": Case(
            "sim buoy --frame NED --duration 120s --out a.csv", {"a.csv": _table, "a.profile.toml": _table}
        ),
        "run": Case("run {}/sea.parquet --filter mahony --out a.parquet", {"a.parquet": files.read}),
        "run .csv": Case("run {}/sea.parquet --filter mahony --out a.csv", {"a.csv": _table, "a.profile.toml": _table}),
        "eval": Case("eval {}/track.parquet {}/sea.parquet --html a.html", {"a.html": _page}),
        "allan": Case(
            "allan {}/rest.parquet --html a.html --plot a.png --card a.json",
            {"a.html": _page, "a.png": _png, "a.json": NoiseCard.load},
        ),
        "calibrate": Case(
            "calibrate accel {}/poses.parquet --out a.json --html a.html",
            {"a.json": CalibrationCard.load, "a.html": _page},
        ),
        "decode .csv": Case("decode {}/buoy.bin --format buoy --out a.csv", {"a.csv": _rows(frames + 1)}),
        "decode .json": Case("decode {}/buoy.bin --format buoy --out a.json", {"a.json": _json}),
        "decode .parquet": Case("decode {}/buoy.bin --format buoy --out a.parquet", {"a.parquet": _parquet}),
        "emulate": Case(
            "emulate buoy --duration 60s --write a.bin --truth b.parquet",
            {
                "a.bin": _bytes(FRAME * frames),
                "b.parquet": files.read,
                "b.card.json": CalibrationCard.load,
            },
        ),
        "convert .mcap": Case("convert {}/sea.parquet a.mcap", {"a.mcap": _mcap}),
        "convert .csv": Case("convert {}/sea.parquet a.csv", {"a.csv": _table, "a.profile.toml": _table}),
        "convert .parquet": Case("convert {}/sea.mcap a.parquet", {"a.parquet": files.read}),
        "convert .tum": Case("convert {}/sea.parquet a.tum", {"a.tum": _rows(12_001)}),
        "convert .txt": Case("convert {}/sea.parquet a.txt", {"a.txt": _rows(12_002)}),
        "repair": Case("verify {}/torn.mcap --repair a.mcap", {"a.mcap": _mcap}),
        "replay": Case("replay {}/line.mcap --out a.parquet", {"a.parquet": files.read}),
    }


def make_inputs(folder: Path) -> None:
    """What the verbs read."""
    for words in (
        "sim buoy --frame NED --duration 120s --out sea.parquet",
        "sim static --frame NED --sensors mpu6000 --unit random --rate 100Hz --duration 300s --out rest.parquet",
        "sim poses --frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --set move=2s --out poses.parquet",
        "run sea.parquet --filter mahony --out track.parquet",
        "convert sea.parquet sea.mcap",
        "emulate buoy --duration 60s --write buoy.bin",
        "record --from buoy.bin --format buoy --filter mahony --frame NED --out line.mcap",
    ):
        run_here(folder, words.split())
    whole = (folder / "sea.mcap").read_bytes()
    (folder / "torn.mcap").write_bytes(whole[: len(whole) * 9 // 10])


def run_here(folder: Path, words: list[str]) -> None:
    """Run a verb in this process, which then has what it imports and compiles."""
    told = StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        code = plumbob(words)
    if code not in (0, 3):
        raise SystemExit(f"plumbob {' '.join(words)} ended with {code}: {told.getvalue()}")


# --- trials -----------------------------------------------------------------------------------------------------


@dataclass
class Counts:
    """What the trials of a verb gave."""

    seconds: float
    stopped: dict[str, int] = field(default_factory=lambda: dict.fromkeys(STOPPED, 0))
    left: int = 0
    wrong: list[str] = field(default_factory=list)


class Disk(NamedTuple):
    """A folder to fill; where nothing may be mounted, the limit of a file's size stands for a full disk."""

    folder: Path
    mounted: bool


class Child:
    """A fork of this process that runs a verb in a folder."""

    def __init__(self, folder: Path, words: list[str], limit: int | None = None) -> None:
        self.started = time.monotonic()
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS.values())  # none may reach a fork before it is one
        self.pid = os.fork()
        if self.pid == 0:
            self._run(folder, words, limit)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS.values())

    @staticmethod
    def _run(folder: Path, words: list[str], limit: int | None) -> None:
        code = 99
        try:
            os.chdir(folder)
            null = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(null, stream)
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS.values())
            code = plumbob(words)
        except KeyboardInterrupt:  # before the verb began, as in the start of any program
            code = 128 + signal.SIGINT
        finally:
            os._exit(code)

    def send_at(self, after: float, number: int) -> None:
        time.sleep(max(0.0, self.started + after - time.monotonic()))
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def wait(self, look: Callable[[], None] = lambda: None) -> int:
        """Exit code, negative for a signal."""
        while True:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return os.waitstatus_to_exitcode(status)
            if time.monotonic() > self.started + LONGEST:
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)
                return 98
            look()
            time.sleep(0.0005)


def temporaries(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".") and path.suffix == ".tmp"]


def rehearse(folder: Path, words: list[str]) -> tuple[float, float, float]:
    """Time of the work, s, and from when to when a file was being written."""
    child, seen = Child(folder, words), []

    def look() -> None:
        if temporaries(folder):
            seen.append(time.monotonic() - child.started)

    code, ended = child.wait(look), time.monotonic() - child.started
    assert code in (0, 3), (words, code)
    return ended, seen[0] if seen else 0.0, seen[-1] if seen else ended


def place_old(folder: Path, case: Case) -> None:
    for name in case.outputs:
        (folder / name).write_bytes(OLD)


def judge(folder: Path, case: Case, *, old: bool, how: str, code: int) -> list[str]:
    """What is wrong after a trial."""
    wrong = [] if code in STOPPED[how] or code in DONE else [f"exit code {code}"]
    for name, read in case.outputs.items():
        path = folder / name
        new = path.exists() and path.read_bytes() != OLD
        if old and not path.exists():
            wrong.append(f"the old {name} is lost")
        if code in DONE and not new:
            wrong.append(f"exit code {code}, but {name} is not written")
        if new:
            try:
                read(path)
            except Exception as error:  # whatever a reader makes of half a file
                wrong.append(f"{name} is torn: {error!r}")
    if how != "SIGKILL":
        wrong += [f"{name} is left" for name in temporaries(folder)]
    return [f"{how}: {what}" for what in wrong]


def empty(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()


def kill_all(folder: Path, case: Case, words: list[str], kills: int, rng: random.Random) -> Counts:
    """Kill a verb by each signal, and count what went wrong."""
    took, first, last = rehearse(folder, words)
    empty(folder)
    found = Counts(seconds=took)
    for how, number in SIGNALS.items():
        for trial in range(kills):
            if old := trial % 4 < 2:
                place_old(folder, case)
            child = Child(folder, words)
            child.send_at(rng.uniform(0.0, took) if trial % 2 else rng.uniform(first, last), number)
            code = child.wait()
            found.stopped[how] += code not in DONE
            found.wrong += judge(folder, case, old=old, how=how, code=code)
            if temporaries(folder):
                found.left += 1
                if found.left <= CLEANED:
                    Child(folder, words).wait()
                    found.wrong += [f"{name} outlives the next run" for name in temporaries(folder)]
            empty(folder)
    return found


def fill_disk(disk: Disk, case: Case, words: list[str], fills: int, rng: random.Random, found: Counts) -> None:
    """Let the disk fill at random amounts of what a verb writes."""
    folder = disk.folder
    Child(folder, words).wait()
    sizes = [path.stat().st_size for path in folder.iterdir()]
    empty(folder)
    for trial in range(fills):
        if old := trial % 2 == 0:
            place_old(folder, case)
        if disk.mounted:
            fill(folder, rng.randrange(sum(sizes)))
        child = Child(folder, words, None if disk.mounted else rng.randrange(max(sizes)))
        code = child.wait()
        found.stopped["full disk"] += code not in DONE
        found.wrong += judge(folder, case, old=old, how="full disk", code=code)
        empty(folder)


def fill(folder: Path, room: int) -> None:
    """Leave room for so many bytes, in whole pages."""
    free = os.statvfs(folder)
    page = free.f_frsize
    size = (free.f_bavail - room // page) * page
    with (folder / "ballast").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, size)


# --- a disk of one's own ----------------------------------------------------------------------------------------

INSIDE = "PLUMBOB_INTERRUPTED_MOUNTS"


def enter_namespace() -> bool:
    """Go on in a namespace in which this user may mount, where the system lets him; say whether this is it."""
    if os.environ.get(INSIDE):
        return True
    unshare = shutil.which("unshare")
    words = [unshare or "", "-rm", "sh", "-c", "mount -t tmpfs -o size=1m tmpfs /mnt"]
    if unshare is None or subprocess.run(words, capture_output=True, check=False).returncode:
        return False
    os.execve(unshare, [unshare, "-rm", sys.executable, *sys.argv], {**os.environ, INSIDE: "yes"})
    return True


@contextlib.contextmanager
def small_disk(folder: Path, *, mounted: bool) -> Iterator[Disk]:
    folder.mkdir()
    if mounted:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(folder)], check=True)
    try:
        yield Disk(folder, mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)


def measure(names: list[str], *, trials: int, seed: int, mounted: bool) -> Iterator[tuple[str, Counts]]:
    """Every case of `names`, all where there are none, as it is done."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as base, small_disk(Path(base) / "disk", mounted=mounted) as disk:
        inputs, folder = Path(base) / "inputs", Path(base) / "work"
        inputs.mkdir()
        folder.mkdir()
        make_inputs(inputs)
        for name, case in cases(inputs).items():
            if names and name not in names and name.split()[0] not in names:
                continue
            words = [*case.words.replace("{}", str(inputs)).split(), "--force"]
            run_here(folder, words)
            empty(folder)
            found = kill_all(folder, case, words, trials, rng)
            fill_disk(disk, case, words, trials, rng, found)
            yield name, found


def row(name: str, one: Counts) -> str:
    counts = [*one.stopped.values(), one.left, len(one.wrong)]
    return f"{name:18}{one.seconds:7.2f}" + "".join(f"{count:>11}" for count in counts)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=20, help="by each signal and on a full disk, for each verb (20)")
    parser.add_argument("--verbs", default="", metavar="A,B", help="these only, as 'convert' or 'convert .mcap'")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    mounted = enter_namespace()
    how = "a file system in memory" if mounted else "the limit of a file's size"
    if not args.json:
        print(f"work that was stopped, of {args.trials} trials each; full disk: {how}; left: temporaries after SIGKILL")
        print(f"{'':18}{'s':>7}" + "".join(f"{word:>11}" for word in (*STOPPED, "left", "wrong")), flush=True)
    found = {}
    names = [name for name in args.verbs.split(",") if name]
    for name, one in measure(names, trials=args.trials, seed=args.seed, mounted=mounted):
        found[name] = one
        if not args.json:
            print(row(name, one), flush=True)
    wrong = [f"{name}: {what}" for name, one in found.items() for what in one.wrong]
    if args.json:
        told = {name: asdict(one) for name, one in found.items()}
        print(json.dumps({"mounted": mounted, "verbs": told, "met": not wrong}, indent=2))
    else:
        print("\n".join(wrong) or "no file torn, no old file lost; what SIGKILL leaves is removed by the next run")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
