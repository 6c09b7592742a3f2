"""The files in which Linux describes an IIO device, read and, for as long as a buffer runs, written."""

import contextlib
import errno
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from plumbob.acquisition.iio_layout import TIMESTAMP, IioChannel, IioLayout, IioType, Matrix, is_known, parse_type
from plumbob.acquisition.opened import NoLine

IDENTITY: Final[Matrix] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

CLOCK: Final = "current_timestamp_clock"
"""Attribute with the clock of the time stamps, from Linux 4.5."""

_RAW = IioType("<", signed=True, bits=32, storage=32)  # what a polled value is packed into
_TRIADS = {"gyr": "anglvel", "acc": "accel", "mag": "magn"}


@dataclass(frozen=True, slots=True)
class IioDevice:
    """A device as the kernel shows it.

    Attributes
    ----------
    name : str
        What its driver calls it, such as ``adxrs290``.
    path, node : Path
        Its folder in sysfs, and its character device.
    """

    name: str
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
    """Device of that number, or of that name.

    Raises
    ------
    NoLine
        ``absent`` where there is none, with a list of those that are; ``ambiguous`` where there are several.
    """
    there = list_devices(sys_root, dev_root)
    folder = f"iio:device{which}" if isinstance(which, int) else which
    found = [device for device in there if folder in {device.path.name, device.name}]
    if not found:
        listed = ", ".join(map(str, there)) or "none"
        raise NoLine("absent", f"There is no IIO device {which}; the devices of this machine: {listed}.")
    if len(found) > 1:
        raise NoLine("ambiguous", f"{which} is {len(found)} devices, {', '.join(map(str, found))}; give the number.")
    return found[0]


def list_devices(sys_root: Path = Path("/sys"), dev_root: Path = Path("/dev")) -> list[IioDevice]:
    """IIO devices of this machine, in the order of their numbers."""
    folders = (sys_root / "bus" / "iio" / "devices").glob("iio:device*")
    ordered = sorted(folders, key=lambda folder: (len(folder.name), folder.name))
    found = [IioDevice("", folder, dev_root / folder.name) for folder in ordered]
    return [IioDevice(device.read("name") or "?", device.path, device.node) for device in found]


def scan_layout(device: IioDevice, chosen: tuple[str, ...] | None) -> IioLayout:
    """What a scan holds with these channels enabled, all of known units by default.

    Raises
    ------
    NoLine
        ``refused`` where the device has no buffer, no such channel, or does not say what its numbers mean.
    """
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
    own = (f"in_{kind}_sampling_frequency" for kind in kinds)
    return next((file for file in own if (device.path / file).is_file()), "sampling_frequency")


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
    found = tuple(name for name in names if is_known(name)) if chosen is None else chosen
    missing = [name for name in found if name not in names]
    if missing or not found:
        lacks = ", ".join(missing) or "channel of a known unit"
        raise NoLine("refused", f"{device} has no {lacks}; its channels: {', '.join(sorted(names)) or 'none'}.")
    return found


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


class Settings:
    """Attributes written for as long as a buffer runs, and put back afterwards.

    Parameters
    ----------
    device : IioDevice
        Whose.
    """

    def __init__(self, device: IioDevice) -> None:
        self._device = device
        self._before: list[tuple[str, str]] = []

    def write(self, attribute: str, value: str) -> None:
        """Write a value, and remember what was there.

        Raises
        ------
        NoLine
            Where the kernel refuses.
        """
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
