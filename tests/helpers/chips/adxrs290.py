"""ADXRS290 on SPI: 100 ms to start, then its six bytes of data behind the command byte (K-290)."""

from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format

START_NS = 100_000_000  # from standby to measurement
DATA, POWER = 0x08, 0x10


class Adxrs290:
    """Its outputs stay as they were in standby and while it starts, which is an assumption."""

    def __init__(self, t_ns=0):
        self.form = find_format("adxrs290").bind()
        self.t_ns, self.since, self.data = t_ns, None, bytes(6)

    def sample(self, values, t_ns):
        """Feel ``gyr.x``, ``gyr.y`` (rad/s) and ``temp_c`` (°C)."""
        self.t_ns = t_ns
        if self.since is not None and t_ns - self.since >= START_NS:
            self.data = encode(self.form, {name: [value] for name, value in values.items()}).tobytes()

    def transfer(self, data):
        """The first byte is the command: 10 writes POWER, 88 reads the data."""
        if data[0] == POWER and data[1] & 2 and self.since is None:
            self.since = self.t_ns
        return b"\0" + self.data[: len(data) - 1] if data[0] == 0x80 | DATA else bytes(len(data))
