"""Strides of a walk from the angular velocity of the legs, and what joints do in them on a scale from 0 to 100 %.

A leg swings ahead faster than it goes back beneath the body: about the axis to the right its rate has a high peak each
stride, in the middle of the swing. The heel touches the ground at the first low behind that, and the toe leaves it at
the last low before [Salarian2004].
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.arm.angles import JointTrack
from plumbob.core.check import Floats
from plumbob.core.series import Series
from plumbob.core.units import deg, to_deg
from plumbob.data.array import ImuArray
from plumbob.data.chain import Chain

PERCENT: Final = np.linspace(0.0, 100.0, 101)
SWING: Final = deg(60.0)
"""A leg of a walk swings ahead faster than this, rad/s: less would be 20° in a third of a slow stride."""
STRIDE: Final = (0.5, 2.5)  # of walk and run: from the fastest to the slowest stride, s
ALIKE: Final = 1.35  # a stride that lasts longer than the median times this, or less than by it, is a turn or a stop
FEWEST: Final = 3  # strides that make a walk
CUT_OFF: Final = 6.0  # Hz: swings are sought below this
_PARTS: Final = ("shank", "foot", "thigh")  # whose swing is seen best first


@dataclass(frozen=True, eq=False, repr=False)
class Strides(Series):
    """Strides of one leg.

    Attributes
    ----------
    side : str
        "_r", "_l".
    start, toe_off, end : ndarray (S,)
        Contact of the heel, toe off, next contact of the heel, s.
    left_out : int
        Strides that last too long or too short beside the others, as at turns and stops.
    names : tuple of str
        Angles of the leg.
    curves : ndarray (S, 101, K)
        Each angle from contact to contact, rad.
    sd : ndarray (K,)
        Claimed standard deviation of an angle, which strides do not average away, rad.
    """

    side: str
    start: Floats
    toe_off: Floats
    end: Floats
    left_out: int
    names: tuple[str, ...]
    curves: Floats = field(repr=False)
    sd: Floats = field(repr=False)

    def __len__(self) -> int:
        return len(self.start)

    @property
    def cadence(self) -> float:
        """Steps of both legs per minute."""
        return float(120.0 / np.mean(self.end - self.start))

    def summary(self) -> dict[str, Any]:
        """Numbers as JSON can hold them: mean and standard deviation over the strides; degrees."""
        last, stance = self.end - self.start, 100.0 * (self.toe_off - self.start) / (self.end - self.start)
        ranges = to_deg(np.ptp(self.curves, axis=1))
        return {
            "strides": len(self), "left_out": self.left_out, "cadence_per_min": self.cadence,
            "stride_s": _both(last), "stance_percent": _both(stance),
            "range_deg": {name: _both(column) for name, column in zip(self.names, ranges.T, strict=True)},
            "claimed_sd_deg": dict(zip(self.names, to_deg(self.sd).tolist(), strict=True)),
        }  # fmt: skip

    def facts(self) -> Mapping[str, str]:
        """Strides, cadence, stance and ranges of motion."""
        numbers = self.summary()
        facts = {
            "strides": f"{len(self)}, {self.left_out} left out",
            "cadence": f"{self.cadence:.1f} steps/min, a stride of {_pair(numbers['stride_s'], '{:.3f}')} s",
            "stance": f"{_pair(numbers['stance_percent'], '{:.1f}')} % of the stride",
        }
        return facts | {
            f"range of {name.removesuffix(self.side)}": f"{_pair(both, '{:.1f}')}°"
            for name, both in numbers["range_deg"].items()
        }

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Share of the stride, and mean and standard deviation over the strides of each angle."""
        columns: dict[str, NDArray[Any]] = {"stride [%]": PERCENT}
        for k, name in enumerate(self.names):
            columns[f"{name} [rad]"] = self.curves[:, :, k].mean(axis=0)
            columns[f"{name}_sd [rad]"] = self.curves[:, :, k].std(axis=0, ddof=1)
        return columns


def _both(values: Floats) -> dict[str, float]:
    return {"mean": float(np.mean(values)), "sd": float(np.std(values, ddof=1))}


def _pair(both: Mapping[str, float], form: str) -> str:
    return f"{form.format(both['mean'])} ± {form.format(both['sd'])}"


def walked(track: JointTrack, chain: Chain, recording: ImuArray) -> dict[str, Strides]:
    """Strides of each leg, by its side; none where the motion is not a walk.

    `track`: joint angles; `chain`: with segments in the axes of the ISB, of the units in `recording`.
    """
    strides = {}
    for side in ("_r", "_l"):
        parts = {body.name: body for body in chain.segments if body.name.removesuffix(side) in _PARTS}
        part = next((parts[name + side] for name in _PARTS if name + side in parts), None)
        if part is None:
            continue
        rate = np.nan_to_num(recording.units[part.unit].usable("gyr") @ part.mount.dcm[2])
        places = [k for k, name in enumerate(track.names) if name.endswith(side)]
        if (leg := _strides(track, rate, places, side)) is not None:
            strides[side] = leg
    return strides


def _strides(track: JointTrack, rate: Floats, places: list[int], side: str) -> Strides | None:
    """Strides of one leg by the rate of a segment of it about its axis to the right, rad/s."""
    from scipy.signal import butter, find_peaks, sosfiltfilt

    step = float(np.median(np.diff(track.t)))
    if 1.0 / step < 2.5 * CUT_OFF or len(rate) < 30:
        return None
    smooth = sosfiltfilt(butter(2, CUT_OFF, fs=1.0 / step, output="sos"), rate)
    swings, _ = find_peaks(smooth, height=SWING, distance=max(1, int(STRIDE[0] / step)), prominence=SWING)
    # a second, lower peak of a stride is less than half of its swing
    swings = swings[smooth[swings] > 0.5 * np.median(smooth[swings])] if len(swings) else swings
    lows, _ = find_peaks(-smooth)
    contacts, leaves = [], []
    for swing in swings:
        after, before = lows[lows > swing], lows[lows < swing]
        if after.size and before.size and max(after[0] - swing, swing - before[-1]) * step < 0.5 * STRIDE[1]:
            contacts.append(int(after[0]))
            leaves.append(int(before[-1]))
    start, end, toe = np.array(contacts[:-1], int), np.array(contacts[1:], int), np.array(leaves[1:], int)
    last = (end - start) * step
    usual = last[(last > STRIDE[0]) & (last < STRIDE[1])]
    if usual.size < FEWEST:
        return None
    same = (last < ALIKE * np.median(usual)) & (last > np.median(usual) / ALIKE)
    same &= [bool(np.isfinite(track.angles[a : b + 1][:, places]).all()) for a, b in zip(start, end, strict=True)]
    if np.count_nonzero(same) < FEWEST:
        return None
    t, start, toe, end = track.t, start[same], toe[same], end[same]
    grids = t[start][:, np.newaxis] + np.outer(t[end] - t[start], 0.01 * PERCENT)
    curves = np.stack([np.interp(grids, t, track.angles[:, k]) for k in places], axis=2)
    assert track.sd is not None
    rows = np.concatenate([np.arange(a, b) for a, b in zip(start, end, strict=True)])
    sd = np.sqrt(np.nanmean(track.sd[rows][:, places] ** 2, axis=0))
    names = tuple(track.names[k] for k in places)
    return Strides(side, t[start], t[toe], t[end], int(np.count_nonzero(~same)), names, curves, sd)
