"""Sensors behind the Linux kernel's IIO drivers: whole scans from a buffer, or single values, polled."""

import contextlib
import errno
import os
import struct
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from plumbob.acquisition.iio_layout import IioLayout
from plumbob.acquisition.iio_sysfs import (
    CLOCK,
    IioDevice,
    Settings,
    find_device,
    rate_file,
    raw_layout,
    refusal,
    scan_layout,
)
from plumbob.acquisition.opened import BackOff, NoLine
from plumbob.acquisition.polled import Polled
from plumbob.acquisition.replug import TAKE_LIMIT, Replug
from plumbob.acquisition.transport import Event, Received
from plumbob.core.errors import LineError, ParameterError, PlumbobError

SYS: Final = Path("/sys")
DEV: Final = Path("/dev")

_UNSIGNED: Final = {"adxrs290": 16}
"""Drivers whose ``in_anglvel_*_raw`` some kernels show unsigned, and the bits of their registers.

Linux drivers/iio/gyro/adxrs290.c before commit fde272e78e, "fix data signedness" (2021)."""


class IioSource(Replug):
    """Whole scans of an IIO buffer, as bytes; `layout` says what they mean.

    The device is set up at opening, and put back as it was at closing. Scans carry the kernel's time stamps on the
    monotonic clock, taken at the interrupt where the driver has one; `Received.t_ns` is when they were read.

    Parameters
    ----------
    device : str or int
        Name that the driver gives, such as ``"adxrs290"``, or number.
    channels : sequence of str, optional
        Such as ``("anglvel_x", "timestamp")``; all whose units are known by default.
    rate : float, optional
        Written to ``sampling_frequency``, Hz; left as it is by default.
    trigger : str, optional
        Name of the trigger that starts a scan; left as it is by default.
    length, watermark : int
        Scans that the kernel keeps while nobody reads, and scans that wake the reader.
    stall_periods : float
        Without a scan for so many periods (and at least 1 s where the rate is unknown), the device is ``stalled``.
    layout : IioLayout, optional
        What the bytes must mean, as read before; a device that says otherwise by now is refused.
    sys_root, dev_root : path
        Where the kernel shows devices.
    wait, back_off, clock, sleep
        As in `Replug`.

    Notes
    -----
    Events: ``opened``, ``stalled``, ``resumed``, ``lost``, ``reopened``, and while it cannot be opened ``absent``,
    ``ambiguous``, ``busy``, ``denied`` or ``refused``. The kernel does not count the scans that a full buffer loses:
    they show as gaps in the time stamps.

    Raises
    ------
    ParameterError
        If an argument can never be right.
    """

    def __init__(
        self,
        device: str | int,
        *,
        channels: Sequence[str] | None = None,
        rate: float | None = None,
        trigger: str | None = None,
        length: int = 4096,
        watermark: int = 1,
        stall_periods: float = 20.0,
        layout: IioLayout | None = None,
        sys_root: str | Path = SYS,
        dev_root: str | Path = DEV,
        wait: bool = False,
        back_off: BackOff | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(f"iio {device}", wait=wait, back_off=back_off, silence=1.0, clock=clock, sleep=sleep)
        if not 1 <= watermark <= length or not stall_periods > 0.0 or (rate is not None and not rate > 0.0):
            raise ParameterError(
                "An IIO buffer needs 1 <= watermark <= length, and a rate and stall_periods above 0, "
                f"but got watermark={watermark}, length={length}, rate={rate}, stall_periods={stall_periods}."
            )
        self._device, self._channels = device, None if channels is None else tuple(channels)
        self._rate, self._trigger, self._length, self._watermark = rate, trigger, length, watermark
        self._stall_periods = stall_periods
        self._roots = Path(sys_root), Path(dev_root)
        self._layout: IioLayout | None = None
        self._must = layout

    @property
    def layout(self) -> IioLayout:
        """What the bytes mean; read from the device, which need not be open; LineError where it cannot be read."""
        if self._layout is None:
            self._layout = _now(lambda: scan_layout(find_device(self._device, *self._roots), self._channels))
        return self._layout

    def _connect(self, patience: float) -> "IioWire":
        device = find_device(self._device, *self._roots)
        self._layout = _as_before(self._must, _described(lambda: scan_layout(device, self._channels)))
        fd = _open_node(device)
        settings = Settings(device)
        try:
            self._set_up(device, settings, self._layout)
        except BaseException:
            settings.restore()
            os.close(fd)
            raise
        return IioWire(fd, device, settings, self._layout, self._clock)

    def _set_up(self, device: IioDevice, settings: Settings, layout: IioLayout) -> None:
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


def _now(describe: Callable[[], IioLayout]) -> IioLayout:
    try:
        return _described(describe)
    except NoLine as no:
        raise LineError(no.text) from no.__cause__


def _described(describe: Callable[[], IioLayout]) -> IioLayout:
    try:
        return describe()
    except PlumbobError as error:
        raise NoLine("refused", str(error)) from error
    except OSError as error:
        raise NoLine("absent", f"the device cannot be read: {error}.") from error


def _as_before(before: IioLayout | None, now: IioLayout) -> IioLayout:
    if before is not None and now != before:
        raise NoLine(
            "refused",
            f"{now.device}: channels, scales, mounting or clock are not what they were when it was first read; "
            "the bytes would be misread. Start again.",
        )
    return now


def _open_node(device: IioDevice) -> int:
    try:
        return os.open(device.node, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise refusal(device, f"{device.node} cannot be opened", error) from error


class IioWire:
    """A buffer that runs."""

    def __init__(
        self, fd: int, device: IioDevice, settings: Settings, layout: IioLayout, clock: Callable[[], int]
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
            raise OSError(errno.ENODEV, "the device has hung up")
        now = self._clock()
        data = self._rest + data
        whole = len(data) - len(data) % self._size
        self._rest = data[whole:]
        return [Received(now, data[:whole])] if whole else []

    def close(self) -> None:
        """Stop the buffer and put the device back as it was."""
        self._settings.restore()
        os.close(self._fd)


class IioPollSource(Polled):
    """Values of ``in_*_raw``, read at a rate, for drivers without a buffer, as that of the ADXRS450 and ADXRS453.

    Each poll is one `Received`: a 32-bit little-endian number for each channel, in the order of `layout`. The time is
    the host's, right after the last channel was read; the channels are not of the same instant.

    Parameters
    ----------
    device : str or int
        Name that the driver gives, such as ``"adxrs453"``, or number.
    rate : float
        Polls per second, Hz.
    channels : sequence of str, optional
        Such as ``("anglvel_z",)``; all whose units are known by default.
    layout : IioLayout, optional
        What the bytes must mean, as in `IioSource`.
    sys_root : path
        Where the kernel shows devices.
    back_off, clock, sleep
        As in `Polled`.

    Notes
    -----
    Events: ``opened``, ``late``, ``lost``, ``reopened``.
    """

    def __init__(
        self,
        device: str | int,
        rate: float,
        *,
        channels: Sequence[str] | None = None,
        layout: IioLayout | None = None,
        sys_root: str | Path = SYS,
        back_off: BackOff | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(f"iio {device}", rate, back_off=back_off, clock=clock, sleep=sleep)
        self._device, self._channels = device, None if channels is None else tuple(channels)
        self._sys_root = Path(sys_root)
        self._layout: IioLayout | None = None
        self._must = layout
        self._files: list[tuple[int, int]] = []  # descriptor, and bits where the kernel forgets the sign

    @property
    def layout(self) -> IioLayout:
        """What the bytes mean; read from the device, which need not be open; LineError where it cannot be read."""
        if self._layout is None:
            self._layout = _now(lambda: raw_layout(self._find(), self._channels))
        return self._layout

    def _find(self) -> IioDevice:
        return find_device(self._device, self._sys_root, DEV)

    def _connect(self) -> str:
        device = self._find()
        self._layout = _as_before(self._must, _described(lambda: raw_layout(device, self._channels)))
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
