"""A rig that is not there, in a process of its own on a pseudo-terminal, for a view that needs no hardware."""

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import ParameterError
from plumbob.core.files import text_of
from plumbob.data import AttitudeTrack
from plumbob.data.cards import CalibrationCard
from plumbob.data.chain import Chain
from plumbob.data.chain_toml import load_chain
from plumbob.door.reading import read
from plumbob.live.emulated import chain_files, running_rig, unit_file
from plumbob.live.rigs.plan import PLANS, Chained
from plumbob.live.session import Session
from plumbob.live.session_toml import SESSION, capture_session, parse_session
from plumbob.live.watch import Note

_FILTER: Final = "mekf"
_BLIND: Final = "integrate"
"""What estimates a rig that has a gyroscope alone."""


@contextmanager
def emulated(
    rig: str, note: Note, line: Mapping[str, Any]
) -> Iterator[tuple[Session, AttitudeTrack | None, Chain | None]]:
    """Session of a rig that runs meanwhile, the truth of its first unit, and its chain, where it is on one.

    Raises
    ------
    ParameterError
        If there is no such rig.
    LineError
        If it does not start.
    """
    if rig not in PLANS:
        raise ParameterError(f"there is no rig '{rig}'; there are {', '.join(PLANS)}.")
    plan = PLANS[rig]
    first, several = plan.units[0].prefix, sum(unit.prefix != "ref" for unit in plan.units) > 1
    with tempfile.TemporaryDirectory(prefix="plumbob-view-") as folder:
        truth = Path(folder) / "truth.parquet"
        note(f"the rig {rig} is emulated: {plan.title}; its truth is the reference")
        with running_rig(rig, "--truth", str(truth)) as port:
            file = unit_file(truth, first)
            recording = read(file)
            card = CalibrationCard.load(file.with_suffix(".card.json"))
            has_force = recording.imu is not None and "acc" in recording.imu.triads
            defaults: dict[str, Any] = {
                "frame": str(plan.frame),
                "filter": _FILTER if has_force else _BLIND,
                "device": card.device,
            }
            defaults |= {"unit": "all" if several else first or None, "calibration": card if not several else None}
            options = {name: value for name, value in line.items() if value is not None and value != {}}
            session = capture_session(port=port, format=rig, **{**defaults, **options})
            if several:
                session = _calibrated(session, truth, [unit.prefix for unit in plan.units])
            chain = load_chain(chain_files(truth)[1]) if isinstance(plan.scenario, Chained) else None
            yield replace(session, name=rig), recording.track, chain


def _calibrated(session: Session, truth: Path, units: Sequence[str]) -> Session:
    """Session whose units have their cards, which a recording of it then holds."""
    tables, cards = [session.texts[SESSION]], dict[str, str]()
    for unit in units:
        path = unit_file(truth, unit).with_suffix(".card.json")
        name = f"{unit}.card.json"
        cards[name] = text_of(path)
        device = CalibrationCard.load(path).device
        tables.append(
            f"[[unit]]\nname = {json.dumps(unit)}\ndevice = {json.dumps(device)}\ncard = {json.dumps(name)}\n"
        )
    return parse_session("\n".join(tables), {**session.texts, **cards}.__getitem__, name=session.name)
