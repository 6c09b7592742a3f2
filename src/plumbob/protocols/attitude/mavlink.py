"""MAVLink 2: HEARTBEAT, ATTITUDE and ATTITUDE_QUATERNION, made by pymavlink (extra ``mavlink``).

Both messages are of forward-right-down axes in NED, the quaternion wxyz [mavlink.io/en/messages/common.html]. They have
no place for quality, so an attitude that is not reliable is not sent; the state of the heartbeat, once a second, says
CALIBRATING then and ACTIVE else. Nor is one whose rates are not known, as the first of a track without samples.
"""

from math import cos, pi, sin
from typing import Any, Final

from plumbob.core.errors import MissingExtraError
from plumbob.protocols.attitude import AttitudeSample
from plumbob.rotations import North

_SECOND: Final = 1_000_000_000
_SYSTEM: Final = 1
_MILLI: Final = 1_000_000


class Mavlink:
    """Encodes attitudes as frames of MAVLink 2, numbered one after the other.

    `system`, `component`: who sends; 1 and 1 are an autopilot, whose attitude a ground station shows.
    """

    def __init__(self, system: int = _SYSTEM, component: int = 1) -> None:
        try:
            from pymavlink.dialects.v20 import common
        except ImportError as error:
            raise MissingExtraError(
                'MAVLink needs pymavlink; install it with: pip install "plumbob[mavlink]".'
            ) from error
        self._known: Any = common
        self._link: Any = common.MAVLink(None, srcSystem=system, srcComponent=component)
        self._next_ns: int | None = None

    def encode(self, a: AttitudeSample) -> bytes | None:
        """Frames of an attitude; None where nothing is due."""
        frames = b""
        if self._next_ns is None or a.elapsed_ns >= self._next_ns:
            self._next_ns = a.elapsed_ns + _SECOND
            frames += self._packed(self._heartbeat(a))
        if a.reliable and a.angles is not None and a.q_nb is not None and a.rates_b is not None:
            for message in self._attitude(a, a.angles, a.q_nb, a.rates_b):
                frames += self._packed(message)
        return frames or None

    def finish(self) -> bytes:
        """Nothing comes behind the last attitude."""
        return b""

    def _packed(self, message: Any) -> bytes:
        frame: bytes = bytes(message.pack(self._link))
        self._link.seq = (self._link.seq + 1) % 256
        return frame

    def _heartbeat(self, a: AttitudeSample) -> Any:
        mav = self._known
        state = mav.MAV_STATE_ACTIVE if a.reliable else mav.MAV_STATE_CALIBRATING
        return mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GENERIC, mav.MAV_AUTOPILOT_GENERIC, 0, 0, state, 3)

    def _attitude(
        self, a: AttitudeSample, angles: tuple[float, float, float], q_nb: tuple[float, ...], rates: tuple[float, ...]
    ) -> list[Any]:
        roll, pitch, yaw = angles
        heading = a.heading_deg(North.TRUE)
        turned = a.declination if heading is not None and a.north is North.MAGNETIC and a.declination else 0.0
        q, yaw = _turn_east(q_nb, turned), (yaw + turned + pi) % (2.0 * pi) - pi
        t_ms = a.elapsed_ns // _MILLI % 2**32
        return [
            self._known.MAVLink_attitude_message(t_ms, roll, pitch, yaw, *rates),
            self._known.MAVLink_attitude_quaternion_message(t_ms, *q, *rates, [0.0] * 4),
        ]


def _turn_east(q: tuple[float, ...], angle: float) -> tuple[float, ...]:
    """Attitude in NED that heads `angle`, rad, farther to the east."""
    w, x, y, z = q
    c, s = cos(0.5 * angle), sin(0.5 * angle)
    return (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)
