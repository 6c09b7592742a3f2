"""Read a session from TOML, strictly, with the format, the card and the noise that it names."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob import forms
from plumbob._files import text_of
from plumbob.cards import CalibrationCard, NoiseCard
from plumbob.data import ImuMeta
from plumbob.errors import DecodeError, FrameError, ParameterError, PlumbobError, guide
from plumbob.forms import Parse
from plumbob.pipeline.iio_format import iio_format
from plumbob.pipeline.offline import Stage, filter_of
from plumbob.pipeline.session import OutputSpec, RecordSpec, ReferenceSpec, Session, SourceSpec
from plumbob.pipeline.source_toml import parse_source
from plumbob.pipeline.sources import KERNEL, described
from plumbob.rigs import find_format
from plumbob.rotations import Frame, North, body_axes, in_body_axes
from plumbob.sensors.format import Format, Message
from plumbob.sensors.format_toml import parse_format
from plumbob.sensors.triads import ranges_of
from plumbob.units import Quantity

GUIDE: Final = guide("sessions.md")
KIND: Final = "plumbob session"
VERSION: Final = 1
SESSION: Final = "session.toml"
"""Under this name a recording keeps the session itself."""
IIO: Final = "iio.json"
"""Under this name it keeps what the kernel said of a device, so that a replay needs none."""

Fetch = Callable[[str], str]
"""Gives the text of a file that the session names."""
Describe = Callable[[SourceSpec], str]
"""Gives what the kernel says of a source, in JSON."""


def load_session(path: str | Path) -> Session:
    """Read a session; files that it names lie beside it, unless their paths are absolute.

    Raises
    ------
    DecodeError
        If a file is missing or no TOML, or a key is unknown, missing or of the wrong type.
    ParameterError, UnitError, FrameError, CalibrationError
        If what it asks for does not exist or does not go together.
    """
    text = text_of(path)
    file = Path(path)
    try:
        return parse_session(text, lambda name: text_of(file.parent / name), name=file.stem)
    except PlumbobError as error:
        raise type(error)(f"{file}: {error}") from error


def recorded_session(texts: Mapping[str, str], name: str) -> Session:
    """Session that a recording holds.

    Raises
    ------
    DecodeError
        If it holds none.
    """

    def fetch(wanted: str) -> str:
        if wanted not in texts:
            raise DecodeError(f"the recording does not hold {wanted}; it was not made by 'plumbob record'.")
        return texts[wanted]

    return parse_session(fetch(SESSION), fetch, name=name, describe=lambda _: fetch(IIO))


def parse_session(text: str, fetch: Fetch, *, name: str, describe: Describe = described) -> Session:
    """Session from TOML text; errors as in `load_session`.

    Parameters
    ----------
    text : str
        The session.
    fetch : callable
        Gives the text of each file that it names.
    name : str
        Short name.
    describe : callable
        Gives what the kernel says of a source; asked only where it is an IIO device.
    """
    texts = {SESSION: text}

    def keep(wanted: str) -> str:
        texts[wanted] = fetch(wanted)
        return texts[wanted]

    found = forms.section("session", forms.toml(text, GUIDE), _SESSION, ("kind", "version"), top=True)
    source: SourceSpec | None = found.get("source")
    if source is not None and source.kind in KERNEL:
        texts[IIO] = describe(source)
        source, form, timed_by = _kernel(source, found, texts[IIO])
        message, unit = form.name, ""
    else:
        form, message, unit = _format(found, keep)
        timed_by = _timed_by(source, form, form.message(message))
        if source is not None and source.kind == "file":
            source = replace(source, settings={**source.settings, "form": form, "message": message})
    imu = found.get("imu", {})
    frame = imu.get("frame")
    meta = _meta(imu, source, form, message, unit)
    card = _card(found, keep)
    if card is not None and card.device != meta.device:
        raise ParameterError(
            f"the card is for device '{card.device}', but imu.device is '{meta.device}'; use the card of this unit, or "
            "name the unit that it is, as [imu] device or --device."
        )
    stage = _stage(found, frame, keep)
    return Session(
        name=name,
        source=source,
        form=form,
        message=message,
        unit=unit,
        meta=meta,
        frame=frame,
        card=card,
        stage=stage,
        reference=_reference(found, form.message(message)),
        record=found.get("record"),
        output=found.get("output", OutputSpec()),
        timed_by=timed_by,
        texts=texts,
    )


def _kernel(source: SourceSpec, found: Mapping[str, Any], told: str) -> tuple[SourceSpec, Format, str]:
    """Source that insists on what the kernel said, its format, and what tells its time."""
    from plumbob.acquire import IioLayout

    if "format" in found:
        raise DecodeError(f"[format] does not go with source.kind = '{source.kind}': the kernel says it; leave it out.")
    layout = IioLayout.from_json(told)
    settings = {**source.settings, "layout": layout}
    form = iio_format(layout, mounted=settings.pop("mount", True))
    timed_by = "poll" if source.kind == "iio-poll" else "kernel" if layout.clock == "monotonic" else "frames"
    return replace(source, settings=settings), form, timed_by


def _timed_by(source: SourceSpec | None, form: Format, message: Message) -> str:
    """What tells the time of a source that is not the kernel's; a poll over SPI must give whole transfers."""
    if source is None:
        return "frames"
    settings = source.settings
    if source.kind == "file" or settings.get("time") == "count":
        if message.of_role("clock") is None and not (settings.get("rate") or form.framing.rate):
            raise ParameterError(f"{form.name} has neither a clock nor a rate to count time by; give source.rate.")
        return "count"
    if source.kind != "spi":
        return "frames"
    size, length = sum(map(len, settings["exchange"])) - settings.get("skip", 0), form.framing.length
    if form.framing.transfers and length and (size <= 0 or size % length):
        raise ParameterError(
            f"a poll gives {size} bytes after source.skip, but a transfer of {form.name} has {length}; "
            "give commands as long as their replies, and skip what comes in while the first of them goes out."
        )
    return "poll"


def _format(tables: Mapping[str, Any], keep: Fetch) -> tuple[Format, str, str]:
    if "format" not in tables:
        raise forms.absent("session", "format")
    found = tables["format"]
    if ("name" in found) == ("file" in found):
        raise DecodeError('format needs either the name of a known device or file = "my.toml".')
    form = find_format(found["name"]) if "name" in found else parse_format(keep(found["file"]))
    form = form.bind(found.get("options", {}))
    return form, form.message(found.get("message", "")).name, found.get("unit", "")


def _meta(imu: Mapping[str, Any], source: SourceSpec | None, form: Format, message: str, unit: str) -> ImuMeta:
    told = {} if source is not None and source.kind in KERNEL else ranges_of(form.message(message), unit)
    axes = imu.get("axes", "x y z")
    ranges: dict[str, Any] = {f"{name}_range": np.abs(in_body_axes(axes, case)) for name, case in told.items()}
    asked = None if source is None else source.settings.get("rate")
    return ImuMeta(
        device=imu.get("device", form.name),
        axes=axes,
        frame=imu.get("frame"),
        declination=imu.get("declination"),
        rate_nominal=asked or form.framing.rate,
        unit_check=False,  # the format says the units
        **ranges,
    )


def _card(found: Mapping[str, Any], keep: Fetch) -> CalibrationCard | None:
    if "calibration" not in found:
        return None
    name = found["calibration"]["card"]
    return CalibrationCard.from_text(keep(name), name)


def _reference(found: Mapping[str, Any], message: Message) -> ReferenceSpec | None:
    if "reference" not in found:
        return None
    asked = ReferenceSpec(found["reference"].get("unit", ""), found["reference"]["north"])
    names = reference_names(asked)
    if lacking := [name for name in names if not any(f.name == name for f in message.fields)]:
        raise ParameterError(
            f"[reference] needs {', '.join(names)} in message {message.name}, which has no {lacking[0]}."
        )
    return asked


def reference_names(spec: ReferenceSpec) -> tuple[str, ...]:
    """Names of the fields that a reference has: heading, pitch, roll."""
    return tuple(f"{spec.unit}.{name}" if spec.unit else name for name in ("heading", "pitch", "roll"))


def _stage(found: Mapping[str, Any], frame: Frame | None, keep: Fetch) -> Stage | None:
    if "estimate" not in found:
        return None
    asked = found["estimate"]
    if frame is None:
        raise FrameError(f"[estimate] needs imu.frame, because there is no default; known are {', '.join(Frame)}.")
    noise = NoiseCard.from_text(keep(asked["noise"]), asked["noise"]) if "noise" in asked else None
    stage = Stage(asked["filter"], asked.get("params", {}), noise=noise)
    filter_of(stage, frame, None)  # refuses what it cannot take, before the start
    return stage


def plain_session(*, form: str | None, source: Mapping[str, Any], **tables: Mapping[str, Any]) -> str:
    """Text of a session of a catalogued format, a format file or none, as the command line makes one of its options."""
    content: dict[str, Mapping[str, Any]] = {"source": source, **tables}
    if form is not None:
        known = {"file": form} if form.endswith(".toml") else {"name": form}
        content["format"] = {**known, **tables.get("format", {})}
    lines = [f'kind = "{KIND}"', f"version = {VERSION}"]
    for name, table in content.items():
        lines += ["", f"[{name}]", *(f"{_key(key)} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return json.dumps(key)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)


def _frame(where: str, value: Any) -> Frame:
    return Frame.parse(forms.text(where, value))


def _north(where: str, value: Any) -> North:
    return North.parse(forms.text(where, value))


def _axes(where: str, value: Any) -> str:
    body_axes(forms.text(where, value))
    return str(value)


def _param(where: str, value: Any) -> Any:
    """Numbers follow the rule for text: where two units are usual, one must stand there."""
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


_FORMAT: Final[dict[str, Parse]] = {
    "name": forms.text,
    "file": forms.text,
    "message": forms.text,
    "unit": forms.text,
    "options": forms.mapping(forms.text),
}
_IMU: Final[dict[str, Parse]] = {
    "device": forms.text,
    "axes": _axes,
    "frame": _frame,
    "declination": forms.quantity(Quantity.ANGLE),
}
_ESTIMATE: Final[dict[str, Parse]] = {"filter": forms.text, "params": forms.mapping(_param), "noise": forms.text}
_REFERENCE: Final[dict[str, Parse]] = {"unit": forms.text, "north": _north}
_RECORD: Final[dict[str, Parse]] = {
    "path": forms.text,
    "rotate": forms.size(Quantity.TIME),
    "rotate_bytes": forms.whole(1),
    "reserve": forms.whole(0),
    "samples": forms.truth,
}
_OUTPUT: Final[dict[str, Parse]] = {"every": forms.size(Quantity.TIME), "text": forms.text}
_SESSION: Final[dict[str, Parse]] = {
    "kind": forms.one_of(KIND),
    "version": forms.version(VERSION),
    "source": parse_source,
    "format": forms.form(_FORMAT),
    "imu": forms.form(_IMU),
    "calibration": forms.form({"card": forms.text}, ("card",)),
    "estimate": forms.form(_ESTIMATE, ("filter",)),
    "reference": forms.form(_REFERENCE, ("north",)),
    "record": lambda where, value: RecordSpec(**forms.section(where, value, _RECORD, ("path",))),
    "output": lambda where, value: OutputSpec(**forms.section(where, value, _OUTPUT)),
}
