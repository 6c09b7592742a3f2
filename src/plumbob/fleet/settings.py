"""What every job of a batch does alike, its hash, and a trial of it before any recording is read."""

import hashlib
import json
import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.files import existing_file
from plumbob.core.version import __version__
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.recording import Recording
from plumbob.door.estimate import estimate
from plumbob.overview.overview import Overview, make_gatherer
from plumbob.overview.report_entry import subject_from
from plumbob.overview.streaming_stats import BURST
from plumbob.quality.tilt import LIMIT
from plumbob.rotations import IDENTITY, Frame, North

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard

Cards = tuple["CalibrationCard", ...]


@dataclass(frozen=True)
class BatchSettings:
    """Of a batch.

    Attributes
    ----------
    how : mapping
        Arguments of `plumbob.estimate` that are not left to their defaults, besides cards; JSON can hold them.
    cards : tuple of CalibrationCard
        One for all, or one for each device.
    by_device : bool
        Whether each card is for the recordings of its own device.
    noise : NoiseCard or None
        Noise of the units.
    burst, tilt_limit : float
        As of `plumbob.report`, s and rad.
    align, settle
        As of `plumbob.evaluate`.
    pages : bool
        Whether a page of each recording is written.
    max_bytes : int
        Bytes that a file behind a URL may have.
    software : str
        Version of the program that must do it.
    """

    how: Mapping[str, Any]
    cards: Cards = ()
    by_device: bool = False
    noise: "NoiseCard | None" = None
    burst: float = BURST
    tilt_limit: float = LIMIT
    align: tuple[str, ...] = ()
    settle: float = 0.0
    pages: bool = False
    max_bytes: int = 4 << 30
    software: str = __version__

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all that a result depends on besides the recording."""
        profile = self.how.get("profile")
        said = {
            "how": {name: str(value) for name, value in self.how.items() if name not in ("params", "profile")},
            "params": {name: str(value) for name, value in self.how.get("params", {}).items()},
            "profile": None if profile is None else existing_file(profile).read_bytes().hex(),
            "cards": [card.text() for card in self.cards],
            "by_device": self.by_device,
            "noise": None if self.noise is None else self.noise.text(),
            "statistics": [str(self.burst), str(self.tilt_limit)],
            "evaluation": [*self.align, str(self.settle)],
            "pages": self.pages,
            "software": self.software,
        }
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()

    def card_for(self, device: str) -> "CalibrationCard | None":
        """Card for the recordings of a device; None where there is no card at all.

        Raises
        ------
        CalibrationError
            If cards are chosen by device, and none is of this one.
        """
        if not self.by_device:
            return self.cards[0] if self.cards else None
        for card in self.cards:
            if card.device == device:
                return card
        raise CalibrationError(
            f"none of the {len(self.cards)} calibration cards is of the device '{device}'. Add its card, or run it "
            "apart without one."
        )

    def prepare(self) -> None:
        """Estimate a short recording at rest, once in a process: wrong options show, and kernels are compiled once.

        Raises
        ------
        ParameterError
            If an option is wrong, or this process runs another version of the program.
        MissingExtraError
            If pages are asked for and cannot be made.
        """
        if self.software != __version__:
            raise ParameterError(
                f"the batch was started by plumbob {self.software}, but this worker runs {__version__}. Install one "
                "version everywhere."
            )
        with _TRYING:
            if self.digest in _TRIED:
                return
            gatherer = make_gatherer(burst=self.burst, tilt_limit=self.tilt_limit)
            how = {name: value for name, value in self.how.items() if name not in ("unit", "profile")}
            made = estimate(_at_rest(self.how.get("frame")), **how, noise=self.noise, follow=gatherer)
            if self.pages:
                Overview((subject_from(made, gatherer),)).page()
            _TRIED.add(self.digest)


_TRYING: Final = threading.Lock()
_TRIED: Final[set[str]] = set()
_TRIAL_NS: Final = 1_767_225_600_000_000_000  # 2026-01-01 UTC, within the years of the World Magnetic Model 2025


def _at_rest(frame: Frame | str | None) -> Recording:
    """Five seconds at rest, level, in a field of 50 µT that dips by 60°, with some noise."""
    frame = Frame.parse(frame or "ENU")
    rng, count = np.random.default_rng(1), 500
    dip = math.pi / 3.0
    field = 50.0 * (math.cos(dip) * frame.north - math.sin(dip) * frame.up)
    imu = ImuData(
        t=np.arange(count, dtype=np.float64) * 0.01,
        gyr=1e-3 * rng.standard_normal((count, 3)),
        acc=G0 * frame.up + 1e-2 * rng.standard_normal((count, 3)),
        mag=field + 0.1 * rng.standard_normal((count, 3)),
        meta=ImuMeta(device="trial", frame=frame, t0_ns=_TRIAL_NS),
    )
    track = AttitudeTrack(t=imu.t, q_nb=np.tile(IDENTITY, (count, 1)), frame=frame, north=North.TRUE)
    return Recording(imu=imu, track=track, name="trial")


def load_cards(given: Any) -> tuple[Cards, bool]:
    """Cards that were given, and whether each is for its own device: of a folder or a sequence it is.

    Raises
    ------
    ParameterError
        If a folder holds none, or two are of one device.
    DecodeError
        If a file is not a card.
    """
    if given is None:
        return (), False
    from plumbob.data.cards import CalibrationCard

    if isinstance(given, str | Path) and Path(given).is_dir():
        files = sorted(Path(given).glob("*.json"))
        if not files:
            raise ParameterError(f"{given} holds no calibration card (*.json). Name a card, or a folder of cards.")
        given = files
    if not isinstance(given, list | tuple):
        return (CalibrationCard.of(given),), False
    cards = tuple(CalibrationCard.of(card) for card in given)
    devices = [card.device for card in cards]
    for device in devices:
        if devices.count(device) > 1:
            raise ParameterError(f"two calibration cards are of the device '{device}'. Keep one of them.")
    return tuple(sorted(cards, key=lambda card: card.device)), True
