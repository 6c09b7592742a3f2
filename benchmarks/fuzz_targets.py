"""What is fuzzed: small files of each format, how a case is made of them, and the command line that reads it."""

import json
import shutil
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any, Final

import numpy as np

from benchmarks.fuzz_mutations import mutated, mutated_text
from benchmarks.harness.decoder_streams import frames_of, settled
from plumbob import Frame, files, simulate
from plumbob.core.errors import PlumbobError
from plumbob.data.recording import Recording
from plumbob.files import header
from plumbob.files.mcap import Recorder, open_log
from plumbob.filters import Filter
from plumbob.live import rows
from plumbob.live.recorded import convert, write_mcap
from plumbob.protocols import format_toml
from plumbob.protocols.attitude.ros2 import CDR, header_and_numbers
from plumbob.protocols.format_toml import device_names, find_format, rig_names
from tests.helpers.live_samples import FORMAT, SESSION, reads, record, stream

Words = Callable[[Path], Sequence[object]]


@dataclass(frozen=True)
class Target:
    """A format.

    Attributes
    ----------
    seeds : list of Path
        Files that are right.
    words : callable
        Command line that reads a file.
    text : bool
        Whether words, numbers and lines are mutated as often as bytes.
    remade : callable, optional
        Writes a file of wrong content, though its checksums hold; every second case, where there is one.
    """

    seeds: list[Path]
    words: Words
    text: bool = False
    remade: Callable[[Random, Path], None] | None = None

    def write(self, rng: Random, case: int) -> Path:
        """The file of a case."""
        seed = rng.choice(self.seeds)
        path = seed.with_name(f"case{seed.suffix}")
        if self.remade and case % 2:
            path.unlink(missing_ok=True)
            self.remade(rng, path)
            return path
        others = [other.read_bytes() for other in self.seeds]
        path.write_bytes(mutated(rng, seed.read_bytes(), others, text=self.text))
        return path


def _recording(rows_: int = 120) -> Recording:
    made = simulate("buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=3, rate=100.0,
                    duration=rows_ / 100.0, mag_rate=100.0)  # fmt: skip
    track = Filter("mahony", frame=Frame.NED, init=made.truth.q_nb[0]).process(made.imu)
    return Recording(imu=made.imu, track=track, name="made", notes=("made for fuzzing",))


def _info(path: Path) -> Sequence[object]:
    return "info", path


# Recordings -----------------------------------------------------------------------------------------------------------


def _parquet(folder: Path) -> Target:
    from plumbob.files.columns import COLUMNS, to_columns

    whole = _recording()
    parts = {"a": whole, "b": replace(whole, track=None), "c": replace(whole, imu=None)}
    for name, part in parts.items():
        files.write(folder / f"{name}.parquet", part)

    def remade(rng: Random, path: Path) -> None:
        """Another header, or other numbers, with a checksum that fits."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        part = parts[rng.choice("abc")]
        columns = {name: values.copy() for name, values in to_columns(part).items()}
        content: Any = header.file_header(part, list(columns))
        if rng.random() < 0.5:
            with_damage = mutated_text(rng, json.dumps(content).encode(), [b"1e400"])
            try:
                content = json.loads(with_damage)
            except (ValueError, RecursionError):
                content = {"imu": with_damage.decode(errors="replace")}
        else:
            values = columns[rng.choice(list(columns))].view(np.uint8)
            for _ in range(rng.choice((1, 8, 64))):
                values[rng.randrange(values.size)] = rng.randrange(256)
        content = content if isinstance(content, dict) else {"imu": content}
        table = pa.table(columns)
        known = {name: {b"unit": COLUMNS[name].unit.encode()} for name in columns}
        schema = pa.schema([table.field(name).with_metadata(known[name]).with_nullable(False) for name in columns])
        try:
            crc = zlib.crc32(b"".join((header.dump(content), *(columns[name].tobytes() for name in sorted(columns)))))
            sealed = header.dump(content | {"crc32": f"{crc:08x}"})
        except (PlumbobError, ValueError):  # not a header that can be written
            sealed = json.dumps(content).encode()
        pq.write_table(pa.table(list(columns.values()), schema=schema.with_metadata({b"plumbob": sealed})), path)

    return Target([folder / f"{name}.parquet" for name in parts], _info, remade=remade)


def _csv(folder: Path) -> Target:
    whole = _recording(60)
    convert(whole, folder / "a.csv")
    return Target([folder / "a.csv"], lambda path: ("info", path, "--profile", folder / "a.profile.toml"), text=True)


def _profile(folder: Path) -> Target:
    convert(_recording(20), folder / "a.csv")
    return Target([folder / "a.profile.toml"], lambda path: ("info", folder / "a.csv", "--profile", path), text=True)


def _text(folder: Path) -> Target:
    """A text with its head, read by a profile of columns with units of its own."""
    rows_ = [f"{i / 100:.3f}\t{i % 7},5\t-1,5\t0,25\t0,0\t0,01\t1,0\t--\n".replace(".", ",") for i in range(50)]
    head = "Logger 7\n***End***\nt\tgx\tgy\tgz\tax\tay\taz\tT\n[s]\t[d]\t[d]\t[d]\t[g]\t[g]\t[g]\t[C]\n"
    (folder / "a.txt").write_text(head + "".join(rows_), encoding="utf-8")
    (folder / "p.toml").write_text(
        'separator = "tab"\ndecimal = ","\nmissing = ["", "--"]\ndevice = "rig"\naxes = "x -y -z"\n'
        '[header]\nmarker = "***End***"\noccurrence = 1\nnames = true\nafter_names = 1\n'
        '[time]\ncolumn = "t"\nunit = "s"\n[gyr]\ncolumns = ["gx", "gy", "gz"]\nunit = "deg/s"\n'
        '[acc]\ncolumns = ["ax", "ay", "az"]\nunit = "g"\nsign = "specific-force"\n'
    )
    return Target([folder / "a.txt"], lambda path: ("info", path, "--profile", folder / "p.toml"), text=True)


def _trial(rows_: int = 40) -> dict[str, Any]:
    rng = np.random.default_rng(5)
    quat = rng.normal(size=(rows_, 4))
    return {
        "imu_gyr": rng.normal(size=(rows_, 3)),
        "imu_acc": rng.normal(size=(rows_, 3)) + [0.0, 0.0, 9.8],
        "imu_mag": rng.normal(size=(rows_, 3)) + [0.0, 20.0, -40.0],
        "opt_quat": quat / np.linalg.norm(quat, axis=1, keepdims=True),
        "movement": np.arange(rows_) >= 4,
        "sampling_rate": 2000.0 / 7.0,
    }


def _hdf5(folder: Path) -> Target:
    import h5py

    for name, how in {"a": {}, "b": {"compression": "gzip", "shuffle": True, "fletcher32": True}}.items():
        with h5py.File(folder / f"{name}.hdf5", "w") as file:
            for key, value in _trial().items():
                file.create_dataset(key, data=value, **(how if np.ndim(value) else {}))
    return Target([folder / "a.hdf5", folder / "b.hdf5"], _info)


def _mat(folder: Path) -> Target:
    import scipy.io

    for name, packed in {"a": True, "b": False}.items():
        scipy.io.savemat(folder / f"{name}.mat", _trial(), do_compression=packed, oned_as="column")
    return Target([folder / "a.mat", folder / "b.mat"], _info)


def _evaluated(folder: Path) -> Target:
    whole = _recording()
    files.write(folder / "truth.parquet", whole)
    files.write(folder / "a.csv", replace(whole, imu=None))
    shutil.copy(folder / "a.profile.toml", folder / "case.profile.toml")  # of the case's file, which lies beside it
    return Target([folder / "a.csv"], lambda path: ("eval", path, folder / "truth.parquet"), text=True)


# Recordings of lines, in MCAP -----------------------------------------------------------------------------------------


def _line(folder: Path) -> Path:
    record(folder / "line.mcap", reads(stream()[: 120 * 30]))
    return folder / "line.mcap"


def _remade_mcap(source: Path) -> Callable[[Random, Path], None]:
    """A recording that holds, with other rows or another word about itself."""
    log = open_log(source)
    messages, about = list(log), dict(log.metadata)

    def remade(rng: Random, path: Path) -> None:
        changed, topic = dict(about), rng.choice(["about", *{message.topic for message in messages}])
        if topic == "about":
            key = rng.choice(list(changed))
            changed[key] = mutated_text(rng, changed[key].encode(), [b"{}"]).decode(errors="replace")
        recorder = Recorder(path, epoch_offset_ns=0, reserve=0, fsync=None)
        recorder.metadata.update(changed)
        with recorder:
            numbers: dict[str, int] = {}
            for message in messages:
                if message.topic not in numbers:
                    raw = message.topic == rows.RAW
                    numbers[message.topic] = (
                        recorder.channel(message.topic, "x") if raw else rows.declare(recorder, message.topic)
                    )
                data = message.data
                if message.topic == topic and rng.random() < 0.1:
                    data = mutated(rng, data, [b"null"], text=topic != rows.RAW)
                recorder.write(numbers[message.topic], message.t_ns, data)

    return remade


def _mcap(words: Words) -> Callable[[Path], Target]:
    def make(folder: Path) -> Target:
        path = _line(folder)
        return Target([path], words, remade=_remade_mcap(path))

    return make


def _decoded_mcap(folder: Path) -> Target:
    path = folder / "decoded.mcap"
    write_mcap(path, _recording(60))
    return Target([path], _info, remade=_remade_mcap(path))


def _foreign_mcap(folder: Path) -> Target:
    from mcap.writer import CompressionType, Writer

    for name, how in {
        "zstd": {"compression": CompressionType.ZSTD},
        "lz4": {"compression": CompressionType.LZ4},
        "bare": {"use_chunking": False},
    }.items():
        with (folder / f"{name}.mcap").open("wb") as stream_:
            writer = Writer(stream_, chunk_size=1024, **how)
            writer.start(profile="ros2", library="another")
            schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b"float64 x\n" * 20)
            channel = writer.register_channel("/imu", "cdr", schema)
            for t_ns, row in zip(range(0, 8 * 10**8, 10**7), np.linspace(6.0, 7.0, 2960).reshape(80, 37), strict=True):
                writer.add_message(channel, t_ns, header_and_numbers(CDR, t_ns, "imu", row.tobytes()), t_ns)
            writer.finish()
    return Target([folder / f"{name}.mcap" for name in ("zstd", "lz4", "bare")], _info)


# Numbers --------------------------------------------------------------------------------------------------------------


def _allan(path: Path) -> Sequence[object]:
    return "allan", path, "--rate", "100 Hz", "--scale", "1 deg/s", "--deviation", "oadev"


def _npy(folder: Path) -> Target:
    values = np.random.default_rng(1).normal(size=(1500, 3))
    np.save(folder / "a.npy", values)
    np.save(folder / "b.npy", values[:, 0].astype(np.int16))
    np.save(folder / "c.npy", np.asfortranarray(values))
    return Target([folder / f"{name}.npy" for name in "abc"], _allan)


def _raw_numbers(folder: Path) -> Target:
    values = np.random.default_rng(1).normal(size=(1500, 3)).astype("<f4")
    (folder / "a.f32").write_bytes(values.tobytes())
    return Target([folder / "a.f32"], lambda path: (*_allan(path), "--columns", 3))


def _number_text(folder: Path) -> Target:
    np.savetxt(folder / "a.txt", np.random.default_rng(1).normal(size=(1200, 3)))
    counts = np.random.default_rng(2).integers(-9, 9, (1200, 2)).tolist()
    (folder / "b.txt").write_text("# counts\n" + "".join(f"{a};{b}\n" for a, b in counts))
    return Target([folder / "a.txt", folder / "b.txt"], _allan, text=True)


# What people write ----------------------------------------------------------------------------------------------------


def _cards(folder: Path) -> Path:
    """Write cards of a unit, and return a recording of it."""
    made = simulate("buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="random", seed=3, rate=100.0,
                    duration=0.6, mag_rate=100.0)  # fmt: skip
    files.write(folder / "rec.parquet", made.imu)
    made.calibration.save(folder / "card.json")
    made.noise.save(folder / "noise.json")
    return folder / "rec.parquet"


def _card(folder: Path) -> Target:
    rec = _cards(folder)
    words = ("run", rec, "--filter", "mahony", "--frame", "NED", "--calibration")
    return Target([folder / "card.json"], lambda path: (*words, path), text=True)


def _card_info(folder: Path) -> Target:
    _cards(folder)
    return Target([folder / "card.json", folder / "noise.json"], _info, text=True)


def _noise_card(folder: Path) -> Target:
    rec = _cards(folder)
    words = ("run", rec, "--filter", "mekf", "--frame", "NED", "--noise")
    return Target([folder / "noise.json"], lambda path: (*words, path), text=True)


def _params(folder: Path) -> Target:
    rec = _cards(folder)
    (folder / "p.toml").write_text('kp = "0.5 1/s"\ngate = "0.08 g"\nmag = "off"\n')
    words = ("run", rec, "--filter", "mahony", "--frame", "NED", "--params")
    return Target([folder / "p.toml"], lambda path: (*words, path), text=True)


def _session(folder: Path) -> Target:
    (folder / "imu9.toml").write_text(FORMAT)
    (folder / "a.bin").write_bytes(stream()[: 60 * 30])
    (folder / "s.toml").write_text(
        SESSION + '[source]\nkind = "file"\npath = "a.bin"\n[output]\nevery = "50 ms"\n', encoding="utf-8"
    )
    return Target([folder / "s.toml"], lambda path: ("record", path, "--duration", "2s"), text=True)


def _format(folder: Path) -> Target:
    (folder / "imu9.toml").write_text(FORMAT)
    (folder / "a.bin").write_bytes(stream()[: 60 * 30])
    words = ("decode", folder / "a.bin", "--out", folder / "a.json", "--force", "--format")
    return Target([folder / "imu9.toml"], lambda path: (*words, path), text=True)


def _format_page(how: Sequence[str]) -> Callable[[Path], Target]:
    def make(folder: Path) -> Target:
        (folder / "imu9.toml").write_text(FORMAT)
        words: Words = lambda path: ("list", "devices", path, *how)  # noqa: E731
        return Target([folder / "imu9.toml", *_catalogue(folder)], words, text=True)

    return make


def _catalogue(folder: Path) -> list[Path]:
    """Formats of the catalogue that need no option, as files."""
    found = []
    for name in ("adxrs453", "hmc5983", "witmotion"):
        found.append(folder / f"{name}.toml")
        found[-1].write_bytes((Path(format_toml.__file__).parent / "catalog" / f"{name}.toml").read_bytes())
    return found


# Raw bytes ------------------------------------------------------------------------------------------------------------


def _raw(name: str) -> Callable[[Path], Target]:
    def make(folder: Path) -> Target:
        form = settled(find_format(name))
        (folder / "a.bin").write_bytes(b"".join(frames_of(form, 60, np.random.default_rng(1))))
        options = [word for key, value in form.chosen.items() for word in ("--option", f"{key}={value}")]
        words = ("--format", name, "--out", folder / "a.json", "--force", *options)
        return Target([folder / "a.bin"], lambda path: ("decode", path, *words))

    return make


TARGETS: Final[dict[str, Callable[[Path], Target]]] = {
    "parquet": _parquet,
    "csv": _csv,
    "txt": _text,
    "track-csv": _evaluated,
    "hdf5": _hdf5,
    "mat": _mat,
    "mcap-info": _mcap(_info),
    "mcap-verify": _mcap(lambda path: ("verify", path)),
    "mcap-replay": _mcap(lambda path: ("replay", path, "--check")),
    "mcap-decoded": _decoded_mcap,
    "mcap-foreign": _foreign_mcap,
    "npy": _npy,
    "numbers-raw": _raw_numbers,
    "numbers-text": _number_text,
    "card": _card,
    "card-info": _card_info,
    "noise-card": _noise_card,
    "params": _params,
    "profile": _profile,
    "session": _session,
    "format": _format,
    "format-c": _format_page(("--c",)),
    "format-page": _format_page(()),
    **{f"raw-{name}": _raw(name) for name in (*device_names(), *rig_names())},
}
NAMES: Final = tuple(TARGETS)


def make(name: str, folder: Path) -> Target:
    """A target, with its files in a folder."""
    return TARGETS[name](folder)
