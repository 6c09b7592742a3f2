"""What the live view's server costs, and how late its messages are, with 1, 5, 10 and 100 clients at 1 kHz.

Of the clients a third connect and never read. Run with ``python -m benchmarks.view_load``; it takes about a minute,
stays on this machine's loopback, and stands in for the process that reads a line with `tests.helpers.feeding`.
"""

import argparse
import asyncio
import json
import os
import struct
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from plumbob.viewer.pipe import PipeMessage
from tests.helpers.feeding import COLUMNS, Body, Served, column, hello, serving

RATE = 1000.0
BATCH = 16  # samples, as the feed sends them: 60 batches a second
FURTHER = ("mahony", "vqf", "madgwick")
COLUMNS = (
    COLUMNS
    + [
        column(f"{name}.{kind}{label}", "attitude", "°")
        for name in FURTHER
        for kind in ("", "sd.", "bias.")
        for label in ("roll", "pitch", "yaw")
    ]
    + [column(f"{name}.{kind}", "residual", "°") for name in FURTHER for kind in ("force_angle", "field_angle")]
)
CLOCK = os.sysconf("SC_CLK_TCK")


@dataclass
class Heard:
    """What a client has heard."""

    late: list[float] = field(default_factory=list)
    ticks: int = 0
    rows: int = 0
    size: int = 0
    jumps: int = 0
    closed: str = ""


def used(pid: int) -> tuple[float, float]:
    """CPU seconds and MiB of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / CLOCK, pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def feed(served: Served, seconds: float, sent: list[int]) -> None:
    """Feed at 1 kHz by the clock."""
    body, count = Body(RATE), int(RATE * seconds)
    begin = time.monotonic()
    for first in range(0, count, BATCH):
        batch = body.batch(first, min(BATCH, count - first))
        values = np.resize(batch.arrays["values"], (len(batch.arrays["t"]), len(COLUMNS)))
        told = batch.content | {"attitudes": {name: batch.content["attitudes"]["mekf"] for name in ("mekf", *FURTHER)}}
        served.feed.writer.write(PipeMessage("batch", told, {**batch.arrays, "values": values}))
        sent[0] = first + BATCH
        time.sleep(max(0.0, begin + (first + BATCH) / RATE - time.monotonic()))


async def read(served: Served, heard: Heard, stop: asyncio.Event) -> None:
    """A client that reads all that comes."""
    from websockets.asyncio.client import connect

    last = -1.0
    async with connect(served.socket_url(), max_size=None, compression=None) as line:
        while not stop.is_set():
            try:
                message = await asyncio.wait_for(line.recv(), 0.5)
            except TimeoutError:
                continue
            now = time.time()
            if isinstance(message, str):
                continue
            kind, size, n, *_ = struct.unpack_from("<6I", message)
            if kind != 1 or not n:
                continue
            heard.ticks += 1
            heard.rows += n
            heard.size += len(message)
            heard.late.append(now - json.loads(message[24 : 24 + size])["sent"])
            t = np.frombuffer(message, "<f8", n, 24 + size)
            heard.jumps += bool(last >= 0.0 and t[0] - last > 0.06)
            last = float(t[-1])


async def ignore(served: Served, stop: asyncio.Event) -> None:
    """A client that shakes hands, and reads no more."""
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port, limit=1024)
    path = served.socket_url().partition(served.host)[2]
    writer.write(
        f"GET {path} HTTP/1.1\r\nHost: {served.host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    await reader.readline()
    writer.transport.pause_reading()
    await stop.wait()
    writer.close()


async def clients(served: Served, count: int, seconds: float) -> tuple[list[Heard], float, float, float]:
    """Let so many clients listen; what each heard, CPU share of the server, its memory before and at its most."""
    stop, heard = asyncio.Event(), [Heard() for _ in range(count - count // 3)]
    _, before = used(served.process.pid)
    tasks = [asyncio.create_task(read(served, one, stop)) for one in heard]
    tasks += [asyncio.create_task(ignore(served, stop)) for _ in range(count // 3)]
    await asyncio.sleep(1.0)
    begin, most = time.monotonic(), before
    spent, _ = used(served.process.pid)
    for one in heard:
        one.late.clear()
    while time.monotonic() - begin < seconds:
        await asyncio.sleep(0.25)
        most = max(most, used(served.process.pid)[1])
    now, _ = used(served.process.pid)
    share = (now - spent) / (time.monotonic() - begin)
    stop.set()
    await asyncio.gather(*tasks, return_exceptions=True)
    return heard, share, before, most


def measure(count: int, seconds: float) -> str:
    """Line of the table for a number of clients."""
    with (
        tempfile.TemporaryDirectory() as folder,
        serving("--clients", str(max(32, count)), folder=Path(folder)) as served,
    ):
        served.feed.say("hello", hello(rate=RATE, columns=COLUMNS))
        sent = [0]
        feeding = threading.Thread(target=feed, args=(served, seconds + 9.0, sent))
        feeding.start()
        asyncio.run(clients(served, 1, 5.0))  # the thread of the Allan deviation compiles or loads its kernels
        heard, share, before, most = asyncio.run(clients(served, count, seconds))
        feeding.join()
        skipped = served.feed.writer.skipped
    late = 1e3 * np.concatenate([one.late for one in heard])
    ticks = sum(one.ticks for one in heard) / len(heard) / (seconds + 1.0)
    size = sum(one.size for one in heard) / max(1, sum(one.ticks for one in heard))
    numbers = [100.0 * share, before, most - before, *np.percentile(late, (50, 99, 100)), ticks, size / 1024]
    counts = (count, count // 3, sum(one.jumps for one in heard), skipped)
    return " ".join(f"{value:8d}" for value in counts) + "".join(f" {value:8.2f}" for value in numbers)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 5, 10, 100])
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    heads = ("clients", "silent", "jumps", "skipped", "CPU %", "RSS MiB", "more", "p50 ms", "p99 ms", "max ms")
    print(" ".join(f"{head:>8}" for head in (*heads, "ticks/s", "KiB/tick")))
    for count in options.clients:
        print(measure(count, options.seconds), flush=True)


if __name__ == "__main__":
    main()
