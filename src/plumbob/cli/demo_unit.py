"""The demo's unit: moved by hand before it goes to sea, decoded from its bytes, and calibrated."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from plumbob.cards import CalibrationCard
    from plumbob.data import ImuData
    from plumbob.sim import Scenario

CARD: Final = "card.json"
CERTIFICATE: Final = "certificate.html"
HAND: Final = "hand.bin"
MOUNTING: Final = "mounting.bin"


def calibrate_unit(out: Path, *, seed: int) -> "CalibrationCard":
    """Calibrate the buoy's unit of a seed by two captures, 40 poses by hand and a raised nose; card and page in `out`.

    The seed is that of the unit and of its noise: the captures and the sea have the same one.
    """
    from plumbob import certificate
    from plumbob.pipeline.calibrate_hand import calibrate_by_hand
    from plumbob.pipeline.calibration import capture, card_of
    from plumbob.pipeline.mounting import mount_by_poses
    from plumbob.rotations import Frame
    from plumbob.sim import scenario

    poses = _decoded(out / HAND, scenario("poses", move=2.0), seed)
    raised = _decoded(out / MOUNTING, scenario("raise"), seed)
    whole = capture(poses, triads=("acc",), if_present=("gyr", "mag"))
    fits = calibrate_by_hand(whole)
    mounted = mount_by_poses(capture(raised, triads=(), base=card_of(whole, fits)), frame=Frame.NED)
    card = card_of(whole, fits, mounted=mounted)
    card.save(out / CARD, overwrite=True)
    facts = {"recording": f"{HAND} and {MOUNTING}, emulated"}
    title = f"Calibration of {card.device}"
    certificate.write_html(out / CERTIFICATE, card, fits, title=title, facts=facts, overwrite=True)
    return card


def _decoded(path: Path, motion: "Scenario", seed: int) -> "ImuData":
    """Samples of a capture, from the bytes that the unit says during a motion, in a file as a logger keeps them."""
    from plumbob._files import replacing
    from plumbob.errors import DecodeError
    from plumbob.pipeline.line import Line
    from plumbob.pipeline.runner import run_line
    from plumbob.pipeline.session_toml import parse_session, plain_session
    from plumbob.pipeline.sinks import Collected
    from plumbob.pipeline.sources import open_source
    from plumbob.rigs import PLANS, load, make_rig

    rig = make_rig(replace(PLANS["buoy"], scenario=motion, duration=motion.duration), load("buoy"), seed=seed)
    with replacing(path, overwrite=True) as temporary:
        temporary.write_bytes(rig.stream())
    device = next(iter(rig.units.values())).imu.meta.device
    text = plain_session(
        form="buoy", source={"kind": "file", "path": str(path)}, imu={"device": device, "frame": "NED"}
    )
    session, found = parse_session(text, str, name=path.stem), Collected()
    run_line(Line(session), open_source(session.source), sinks=[found])
    imu = found.imu(calibrated=False)
    if imu is None:
        raise DecodeError(f"{path} holds no sample that could be decoded.")
    return imu
