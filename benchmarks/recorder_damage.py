"""Damage a recording in many ways: is a row ever wrong, and how many are lost?

Single flipped bits, zeroed and swapped blocks of 512 bytes, and cuts, each at random places. The same flips are read by
the MCAP library's streaming reader with all its checks, for comparison.

    python -m benchmarks.recorder_damage [--flips 10000] [--json]
"""

import argparse
import json
import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from plumbob.files.mcap import Recorder, Schema, open_log

Row = tuple[str, int, int, bytes]
BLOCK = 512


def make(path: Path) -> list[Row]:
    """A recording of 1.2 s: a raw channel and a decoded one, 100 rows a second each."""
    recorder = Recorder(path, epoch_offset_ns=10**18, reserve=0)
    numbers = {
        "raw": recorder.channel("raw", "x"),
        "imu": recorder.channel("imu", "json", Schema("S", "jsonschema", b"{}")),
    }
    rows, rng = [], random.Random(1)
    with recorder:
        for i in range(120):
            for topic, number in numbers.items():
                data = rng.randbytes(12) if topic == "raw" else json.dumps({"i": i, "x": rng.gauss(0, 1)}).encode()
                recorder.write(number, i * 10**7, data)
                rows.append((topic, i, i * 10**7, data))
    return rows


def flips(raw: bytes, count: int, rng: random.Random) -> Iterator[bytes]:
    for _ in range(count):
        damaged = bytearray(raw)
        damaged[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        yield bytes(damaged)


def zeroed(raw: bytes, count: int, rng: random.Random) -> Iterator[bytes]:
    for _ in range(count):
        at = rng.randrange(len(raw) - BLOCK)
        yield raw[:at] + bytes(BLOCK) + raw[at + BLOCK :]


def swapped(raw: bytes, count: int, rng: random.Random) -> Iterator[bytes]:
    for _ in range(count):
        blocks = [raw[i : i + BLOCK] for i in range(0, len(raw), BLOCK)]
        i, j = rng.sample(range(len(blocks) - 1), 2)
        blocks[i], blocks[j] = blocks[j], blocks[i]
        yield b"".join(blocks)


def cuts(raw: bytes, count: int, rng: random.Random) -> Iterator[bytes]:
    for _ in range(count):
        yield raw[: rng.randrange(len(raw))]


def ours(path: Path) -> tuple[list[Row], bool]:
    """Rows, and whether anything is said to be wrong."""
    log = open_log(path)
    rows = [(row.topic, row.sequence, row.t_ns, row.data) for row in log]
    return rows, bool(log.damage or log.lost or not log.clean)


def library(path: Path) -> tuple[list[Row], bool]:
    """The same by the MCAP library."""
    from mcap.reader import NonSeekingReader

    rows: list[Row] = []
    try:
        with path.open("rb") as file:
            reader = NonSeekingReader(file, validate_crcs=True)
            for _, channel, message in reader.iter_messages(log_time_order=False):
                rows.append((channel.topic, message.sequence, message.log_time - 10**18, message.data))
    except Exception:  # it raises many kinds
        return rows, True
    return rows, False


def judge(
    path: Path, rows: list[Row], files: Iterator[bytes], read: Callable[[Path], tuple[list[Row], bool]]
) -> dict[str, float]:
    known = set(rows)
    found = {"files": 0, "wrong_rows": 0, "lost_mean": 0.0, "lost_most": 0, "lost_unsaid": 0, "nothing_said": 0}
    for content in files:
        path.write_bytes(content)
        got, said = read(path)
        lost = len(known - set(got))
        found["files"] += 1
        found["wrong_rows"] += sum(row not in known for row in got) + len(got) - len(set(got))
        found["lost_mean"] += lost
        found["lost_most"] = max(found["lost_most"], lost)
        found["lost_unsaid"] += bool(lost) and not said
        found["nothing_said"] += not said
    found["lost_mean"] /= max(1, found["files"])
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flips", type=int, default=10_000)
    parser.add_argument("--others", type=int, default=1000, help="zeroed and swapped blocks and cuts, each")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        rows = make(path)
        raw = path.read_bytes()
        cases = {
            "flips": (flips, args.flips),
            "zeroed": (zeroed, args.others),
            "swapped": (swapped, args.others),
            "cuts": (cuts, args.others),
        }
        found = {
            f"{name}, {who}": judge(path, rows, make_files(raw, count, random.Random(2)), read)
            for name, (make_files, count) in cases.items()
            for who, read in (("plumbob", ours), ("mcap library", library))
        }
    met = all(one["wrong_rows"] == one["lost_unsaid"] == 0 for name, one in found.items() if "plumbob" in name)
    met = met and found["flips, plumbob"]["lost_most"] <= 20
    if args.json:
        print(json.dumps(found | {"met": met}, indent=2))
    else:
        print(f"{len(rows)} rows in chunks of 20, {len(raw)} bytes")
        print(f"{'':24}{'files':>8}{'wrong rows':>12}{'lost, mean':>12}{'lost, most':>12}", end="")
        print(f"{'lost unsaid':>13}{'nothing said':>14}")
        for name, one in found.items():
            print(
                f"{name:24}{one['files']:8}{one['wrong_rows']:12}{one['lost_mean']:12.1f}{one['lost_most']:12}"
                f"{one['lost_unsaid']:13}{one['nothing_said']:14}"
            )
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
