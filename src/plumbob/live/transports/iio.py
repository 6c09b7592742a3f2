"""Linux IIO devices: the files that describe them, and their buffers as a source."""

import contextlib
import errno
import os
import struct
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Unpack

from plumbob.core.errors import LineError, ParameterError, PlumbobError
from plumbob.core.event import Event
from plumbob.live.transports.iio_layout import TIMESTAMP, IioChannel, IioLayout, IioType, Matrix, is_known, parse_type
from plumbob.live.transports.polled import Polled
from plumbob.live.transports.transport import TAKE_LIMIT, NoLine, Pace, Patience, Received, Replug

IDENTITY: Final[Matrix] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

CLOCK: Final = "current_timestamp_clock"  # attribute with the clock of the time stamps, from Linux 4.5

_RAW = IioType("<", signed=True, bits=32, storage=32)  # what a polled value is packed into
_TRIADS = {"gyr": "anglvel", "acc": "accel", "mag": "magn"}


@dataclass(frozen=True, slots=True)
class IioDevice:
    """A device as the kernel shows it."""

    name: str  # what its driver calls it, such as ``adxrs290``
    # path, node: its folder in sysfs, and its character device
    path: Path
    node: Path

    def __str__(self) -> str:
        return f"{self.path.name} ({self.name})"

    def read(self, attribute: str) -> str | None:
        """Text of an attribute; None where the device has no such."""
        file = self.path / attribute
        return file.read_text(encoding="ascii", errors="replace").strip() if file.is_file() else None

    def number(self, channel: str, what: str) -> float | None:
        """Number that a channel has, alone or with others of its kind, as ``scale`` in ``in_anglvel_scale``."""
        parts = channel.split("_")
        for count in range(len(parts), 0, -1):
            text = self.read(f"in_{'_'.join(parts[:count])}_{what}")
            if text is not None:
                return _float(self, f"{channel}: {what}", text)
        return None


def _float(device: IioDevice, what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise NoLine("refused", f"{device}: {what} is '{text}', which is not a number.") from None


def find_device(which: str | int, sys_root: Path, dev_root: Path) -> IioDevice:
    """Device of that number, or of that name."""
    there = list_devices(sys_root, dev_root)
    folder = f"iio:device{which}" if isinstance(which, int) else which
    named = [device for device in there if folder in {device.path.name, device.name}]
    if not named:
        listed = ", ".join(map(str, there)) or "none"
        raise NoLine("absent", f"There is no IIO device {which}; the devices of this machine: {listed}.")
    if len(named) > 1:
        raise NoLine("ambiguous", f"{len(named)} devices match {which}: {', '.join(map(str, named))}; give the number.")
    return named[0]


def list_devices(sys_root: Path = Path("/sys"), dev_root: Path = Path("/dev")) -> list[IioDevice]:
    """IIO devices of this machine, in the order of their numbers."""
    folders = (sys_root / "bus" / "iio" / "devices").glob("iio:device*")
    ordered = sorted(folders, key=lambda folder: (len(folder.name), folder.name))
    devices = [IioDevice("", folder, dev_root / folder.name) for folder in ordered]
    return [IioDevice(device.read("name") or "?", device.path, device.node) for device in devices]


def scan_layout(device: IioDevice, chosen: tuple[str, ...] | None) -> IioLayout:
    """What a scan holds with these channels enabled, all of known units by default."""
    names = _elements(device)
    channels = []
    for name in _choose(device, names, chosen):
        index, kind = (device.read(f"scan_elements/in_{name}_{what}") for what in ("index", "type"))
        if index is None or kind is None:
            raise NoLine("refused", f"{device}: scan element {name} has no index or no type.")
        scale, offset = (1.0, 0.0) if name == TIMESTAMP else _scale(device, name)
        channels.append(IioChannel(name, int(_float(device, name, index)), parse_type(kind), scale, offset))
    channels.sort(key=lambda channel: channel.index)
    clock = "monotonic" if device.read(CLOCK) is not None else "realtime"
    stamped = any(channel.name == TIMESTAMP for channel in channels)
    return IioLayout(device.name, tuple(channels), _mounts(device, channels), clock if stamped else "")


def rate_file(device: IioDevice, channels: Sequence[IioChannel]) -> str:
    """Attribute with the rate of these channels: their own, or that of the device, which may be missing too."""
    kinds = dict.fromkeys(channel.name.split("_")[0] for channel in channels if channel.name != TIMESTAMP)
    files = (f"in_{kind}_sampling_frequency" for kind in kinds)
    return next((file for file in files if (device.path / file).is_file()), "sampling_frequency")


def raw_layout(device: IioDevice, chosen: tuple[str, ...] | None) -> IioLayout:
    """What the values of ``in_*_raw`` mean when each is packed into 32 bits; errors as in `scan_layout`."""
    names = sorted(file.name[3:-4] for file in device.path.glob("in_*_raw"))
    chosen = _choose(device, names, chosen)
    channels = [IioChannel(name, i, _RAW, *_scale(device, name)) for i, name in enumerate(chosen)]
    return IioLayout(device.name, tuple(channels), _mounts(device, channels))


def _elements(device: IioDevice) -> list[str]:
    names = [file.name[3:-3] for file in (device.path / "scan_elements").glob("in_*_en")]
    if not names or not (device.path / "buffer").is_dir():
        raise NoLine(
            "refused", f"{device} has no buffer, so it can only be polled: IioPollSource, or kind = 'iio-poll'."
        )
    return names


def _choose(device: IioDevice, names: list[str], chosen: tuple[str, ...] | None) -> tuple[str, ...]:
    selected = tuple(name for name in names if is_known(name)) if chosen is None else chosen
    missing = [name for name in selected if name not in names]
    if missing or not selected:
        lacks = ", ".join(missing) or "channel of a known unit"
        raise NoLine("refused", f"{device} has no {lacks}; its channels: {', '.join(sorted(names)) or 'none'}.")
    return selected


def _scale(device: IioDevice, name: str) -> tuple[float, float]:
    if not is_known(name):
        raise NoLine("refused", f"{device}: the unit of '{name}' is not known here; leave it out.")
    scale = device.number(name, "scale")
    if scale is None:
        raise NoLine("refused", f"{device}: {name} has no scale, so its unit is unknown. Leave it out.")
    return scale, device.number(name, "offset") or 0.0


def _mounts(device: IioDevice, channels: list[IioChannel]) -> dict[str, Matrix]:
    there = {channel.name.split("_")[0] for channel in channels}
    mounts = {}
    for triad, kind in ((triad, kind) for triad, kind in _TRIADS.items() if kind in there):
        files = (f"in_{kind}_mount_matrix", "in_mount_matrix", "mount_matrix")
        text = next((text for file in files if (text := device.read(file)) is not None), None)
        if text is not None and (matrix := _matrix(device, text)) != IDENTITY:
            mounts[triad] = matrix
    return mounts


def _matrix(device: IioDevice, text: str) -> Matrix:
    rows = tuple(tuple(_float(device, "mount matrix", x) for x in row.split(",")) for row in text.split(";"))
    if [len(row) for row in rows] != [3, 3, 3]:
        raise NoLine("refused", f"{device}: the mount matrix '{text}' is not three rows of three numbers.")
    return rows


class BufferAttributes:
    """Attributes written for as long as a buffer runs, and put back afterwards."""

    def __init__(self, device: IioDevice) -> None:
        self._device = device
        self._before: list[tuple[str, str]] = []

    def write(self, attribute: str, value: str) -> None:
        """Write a value, and remember what was there."""
        before = self._device.read(attribute)
        if before is None:
            raise NoLine("refused", f"{self._device} has no {attribute}, so it cannot be set to {value}.")
        if before != value:
            self._put(attribute, value)
            self._before.append((attribute, before))

    def stop(self) -> None:
        """Stop a buffer that a program left running when it was killed."""
        self._put("buffer/enable", "0")

    def restore(self) -> None:
        """Put back what was there, as far as the device is still there, the last first."""
        while self._before:
            attribute, before = self._before.pop()
            with contextlib.suppress(OSError):
                (self._device.path / attribute).write_text(before or "\n", encoding="ascii")

    def _put(self, attribute: str, value: str) -> None:
        try:
            (self._device.path / attribute).write_text(value, encoding="ascii")
        except OSError as error:
            raise refusal(self._device, f"{attribute} cannot be set to {value}", error) from error


def refusal(device: IioDevice, what: str, error: OSError) -> NoLine:
    """Why the kernel did not let us, in words that help."""
    if error.errno in {errno.EACCES, errno.EPERM}:
        return NoLine("denied", f"{device}: no permission, {what}; write a udev rule for it, or run as root.")
    if error.errno == errno.EBUSY:
        return NoLine("busy", f"{device} is in use by another program, {what}; end it first (iiod holds devices too).")
    if error.errno in {errno.ENOENT, errno.ENODEV, errno.ENXIO}:
        return NoLine("absent", f"{device}: {what}: {error.strerror}.")
    text = f"{device}: {what}: {error.strerror}"
    if what.startswith("buffer/enable"):
        text += "; does it need a trigger (trigger=...), or refuse this set of channels"
    return NoLine("refused", f"{text}.")


SYS: Final = Path("/sys")
DEV: Final = Path("/dev")

_UNSIGNED: Final = {"adxrs290": 16}
"""Drivers whose ``in_anglvel_*_raw`` some kernels show unsigned, and the bits of their registers.

Linux drivers/iio/gyro/adxrs290.c before commit fde272e78e, "fix data signedness" (2021)."""


class _DescribedSource:
    """A source whose bytes mean what the kernel says of its device, which has to be what `_must` says, if anything."""

    _device: str | int
    _channels: tuple[str, ...] | None
    _roots: tuple[Path, Path]
    _must: IioLayout | None
    _layout: IioLayout | None = None

    @abstractmethod
    def _describe(self, device: IioDevice) -> IioLayout:
        """What the kernel says."""

    @property
    def layout(self) -> IioLayout:
        """What the bytes mean; read from the device, which need not be open; LineError where it cannot be read."""
        if self._layout is None:
            try:
                self._layout = self._identified()[1]
            except NoLine as no:
                raise LineError(no.text) from no.__cause__
        return self._layout

    def _identified(self) -> tuple[IioDevice, IioLayout]:
        """Device, and its layout; NoLine where it cannot be read, or has become another."""
        try:
            device = find_device(self._device, *self._roots)
            layout = self._describe(device)
        except PlumbobError as error:
            raise NoLine("refused", str(error)) from error
        except OSError as error:
            raise NoLine("absent", f"the device cannot be read: {error}.") from error
        if self._must not in (None, layout):
            raise NoLine(
                "refused",
                f"{layout.device}: channels, scales, mounting or clock have changed since it was first read; "
                "the bytes would be misread. Start again.",
            )
        return device, layout


class IioSource(_DescribedSource, Replug):
    """Whole scans of an IIO buffer, as bytes; a device whose scans are not as a `layout` says is refused.

    The device is set up at opening, and put back as it was at closing. Scans carry the kernel's time stamps on the
    monotonic clock, taken at the interrupt where the driver has one; `Received.t_ns` is when they were read. Rate (Hz)
    and trigger stay as they are where not named; `length` are scans that the kernel keeps while nobody reads,
    `watermark` those that wake the reader. Without a scan for `stall_periods` (at least 1 s where the rate is unknown)
    the device is ``stalled``.

    The kernel does not count the scans that a full buffer loses: they show as gaps in the time stamps.
    """

    def __init__(
        self, device: str | int, *, channels: Sequence[str] | None = None, rate: float | None = None,
        trigger: str | None = None, length: int = 4096, watermark: int = 1, stall_periods: float = 20.0,
        layout: IioLayout | None = None, sys_root: str | Path = SYS, dev_root: str | Path = DEV,
        **patience: Unpack[Patience],
    ) -> None:  # fmt: skip
        super().__init__(f"iio {device}", silence=1.0, **patience)
        if not 1 <= watermark <= length or not stall_periods > 0.0 or (rate is not None and not rate > 0.0):
            raise ParameterError(
                "An IIO buffer needs 1 <= watermark <= length, and a rate and stall_periods above 0, "
                f"but got watermark={watermark}, length={length}, rate={rate}, stall_periods={stall_periods}."
            )
        self._device, self._channels = device, None if channels is None else tuple(channels)
        self._rate, self._trigger, self._length, self._watermark = rate, trigger, length, watermark
        self._stall_periods = stall_periods
        self._roots = Path(sys_root), Path(dev_root)
        self._must = layout

    def _describe(self, device: IioDevice) -> IioLayout:
        return scan_layout(device, self._channels)

    def _connect(self, patience: float) -> "IioWire":
        device, self._layout = self._identified()
        fd = _open_node(device)
        settings = BufferAttributes(device)
        try:
            self._set_up(device, settings, self._layout)
        except BaseException:
            settings.restore()
            os.close(fd)
            raise
        return IioWire(fd, device, settings, self._layout, self._clock)

    def _set_up(self, device: IioDevice, settings: BufferAttributes, layout: IioLayout) -> None:
        settings.stop()  # the node was free, so nobody reads what may still run
        if self._trigger is not None:
            settings.write("trigger/current_trigger", self._trigger)
        if self._rate is not None:
            settings.write(rate_file(device, layout.channels), f"{self._rate:g}")
        if device.read(CLOCK) is not None:
            settings.write(CLOCK, "monotonic")  # the default, real time, steps
        chosen = {channel.name for channel in layout.channels}
        for file in sorted((device.path / "scan_elements").glob("in_*_en")):
            settings.write(f"scan_elements/{file.name}", str(int(file.name[3:-3] in chosen)))
        settings.write("buffer/length", str(self._length))
        if device.read("buffer/watermark") is not None:
            settings.write("buffer/watermark", str(self._watermark))
        self._silence_ns = self._patience_ns(device, layout)
        settings.write("buffer/enable", "1")

    def _patience_ns(self, device: IioDevice, layout: IioLayout) -> int:
        text = device.read(rate_file(device, layout.channels))
        try:
            rate = float(text or "")
        except ValueError:
            return 1_000_000_000
        return round(max(self._stall_periods, 2.0 * self._watermark) / rate * 1e9) if rate > 0.0 else 1_000_000_000


def _open_node(device: IioDevice) -> int:
    try:
        return os.open(device.node, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise refusal(device, f"{device.node} cannot be opened", error) from error


class IioWire:
    """A buffer that runs."""

    def __init__(
        self, fd: int, device: IioDevice, settings: BufferAttributes, layout: IioLayout, clock: Callable[[], int]
    ) -> None:
        channels = ", ".join(channel.name for channel in layout.channels)
        rate = device.read(rate_file(device, layout.channels)) or "?"
        self.where = f"{device}, {channels}, {layout.size} bytes a scan, {rate} Hz,"
        self._fd, self._settings, self._size, self._clock = fd, settings, layout.size, clock
        self._rest = b""

    def fileno(self) -> int:
        """Descriptor of the character device."""
        return self._fd

    def take(self) -> list[Received | Event]:
        """All whole scans that are there."""
        data = os.read(self._fd, TAKE_LIMIT)
        if not data:
            raise OSError(errno.ENODEV, "the device has disconnected")
        now = self._clock()
        data = self._rest + data
        end = len(data) - len(data) % self._size
        self._rest = data[end:]
        return [Received(now, data[:end])] if end else []

    def close(self) -> None:
        """Stop the buffer and put the device back as it was."""
        self._settings.restore()
        os.close(self._fd)


class IioPollSource(_DescribedSource, Polled):
    """Values of ``in_*_raw``, read at a rate, for drivers without a buffer, as that of the ADXRS450 and ADXRS453.

    Each poll is one `Received`: a 32-bit little-endian number for each channel, in the order of `layout`. The time is
    the host's, right after the last channel was read; the channels are not of the same instant.
    """

    def __init__(
        self, device: str | int, rate: float, *, channels: Sequence[str] | None = None, layout: IioLayout | None = None,
        sys_root: str | Path = SYS, **pace: Unpack[Pace],
    ) -> None:  # fmt: skip
        super().__init__(f"iio {device}", rate, **pace)
        self._device, self._channels = device, None if channels is None else tuple(channels)
        self._roots, self._must = (Path(sys_root), DEV), layout
        self._files: list[tuple[int, int]] = []  # descriptor, and bits where the kernel forgets the sign

    def _describe(self, device: IioDevice) -> IioLayout:
        return raw_layout(device, self._channels)

    def _connect(self) -> str:
        device, self._layout = self._identified()
        for channel in self._layout.channels:
            bits = _UNSIGNED.get(device.name, 0) if channel.name.startswith("anglvel") else 0
            self._files.append((os.open(device.path / f"in_{channel.name}_raw", os.O_RDONLY), bits))
        return f"{device}: {', '.join(channel.name for channel in self._layout.channels)}"

    def _ask(self) -> bytes:
        try:
            values = [_signed(int(os.pread(fd, 64, 0)), bits) for fd, bits in self._files]
            return struct.pack(f"<{len(values)}i", *values)
        except (ValueError, struct.error) as error:
            raise OSError(errno.EIO, f"a raw value is not a 32-bit number ({error})") from error

    def _let_go(self) -> None:
        while self._files:
            with contextlib.suppress(OSError):
                os.close(self._files.pop()[0])


def _signed(value: int, bits: int) -> int:
    """Give a value its sign back; one of 16 bits cannot reach 2¹⁵ unless its sign was lost."""
    return value - (1 << bits) if bits and value >= 1 << (bits - 1) else value
