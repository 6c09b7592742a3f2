"""The counters of a UART's driver."""

import errno
import struct

from plumbob.live.transports.serial_line import EVERY_NS, TIOCGICOUNT, Overruns


class Driver:
    """`struct serial_icounter_struct` of linux/serial.h: cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk,
    buf_overrun, reserved[9]."""

    frame = overrun = parity = buf_overrun = asked = 0
    error = None

    def __call__(self, fd, request, argument):
        assert (fd, request, len(argument)) == (7, TIOCGICOUNT, 80)
        self.asked += 1
        if self.error:
            raise self.error
        told = (self.frame, self.overrun, self.parity, 9, self.buf_overrun)
        return struct.pack("=20i", 1, 2, 3, 4, 1000, 6, *told, *range(9))


def test_only_what_is_new_is_told_by_a_driver_with_counters():
    driver = Driver()
    driver.overrun = driver.frame = 5  # from before the port was opened
    counters = Overruns(7, "ttyX", ioctl=driver)
    assert counters.ask(0) == []
    driver.overrun, driver.buf_overrun, driver.parity = 7, 10, 3
    assert counters.ask(EVERY_NS - 1) == []
    dropped, damaged = counters.ask(EVERY_NS)
    assert (dropped.kind, dropped.count, dropped.text) == ("dropped", 12, "ttyX: the driver could not keep 12 bytes.")
    assert (damaged.kind, damaged.count) == ("damaged", 3)
    assert "baud" in damaged.text
    assert counters.ask(2 * EVERY_NS) == []
    driver.error = OSError(errno.EIO, "gone")
    assert counters.ask(3 * EVERY_NS) == []
    driver = Driver()
    driver.error = OSError(errno.ENOTTY, "no")
    counters = Overruns(7, "pty", ioctl=driver)
    assert counters.ask(0) == counters.ask(EVERY_NS) == []
    assert driver.asked == 1
