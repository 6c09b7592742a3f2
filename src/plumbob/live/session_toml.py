"""Read a session from TOML, strictly, with the format, the card and the noise that it names."""

import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core import check, schema, units
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, UnitError, unknown_name
from plumbob.core.files import reading, text_of
from plumbob.core.params import describe
from plumbob.core.resources import guide
from plumbob.core.schema import Parse, toml_text
from plumbob.core.units import Quantity
from plumbob.data import ImuMeta
from plumbob.data.array_toml import ARRAY, UNIT, MountedUnit, listed_units
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.data.cards.file import Card
from plumbob.data.earth_field import earth_field_at, parse_place
from plumbob.files.profile import parse_profile, toml_value
from plumbob.filters import SMOOTHER, CommonParams, load
from plumbob.filters.known import ARRAY_FILTERS, ARRAY_SCHEMES
from plumbob.filters.offline import Stage, lagged, make_follower
from plumbob.filters.start import TRUTH_WORD
from plumbob.live import session as parts
from plumbob.live.lines import LineFormat, described_imu, line_format
from plumbob.live.listen import STDIN
from plumbob.live.sources import KERNEL, described
from plumbob.protocols.decode import full_scales, prefix_by_unit, unit_prefix
from plumbob.protocols.format import HEX, Format, Message
from plumbob.protocols.format_toml import FORMAT, find_format, parse_format
from plumbob.rotations import Frame, North, body_axes, in_body_axes

GUIDE: Final = guide("sessions.md")
KIND: Final = "plumbob session"
VERSION: Final = 1
SESSION: Final = "session.toml"  # under this name a recording keeps the session itself
IIO: Final = "iio.json"  # under this name it keeps what the kernel said of a device, so that a replay needs none
POSE: Final = "chain_pose.toml"  # and for the angles at which a chain began that was followed before
PLACE: Final = "earth_field.json"  # the same for the field at the session's place: neither model nor date is needed
ALL: Final = "all"  # word for all units of a frame

Fetch = Callable[[str], str]  # gives the text of a file that the session names
Describe = Callable[[parts.SourceSpec], str]  # gives what the kernel says of a source, in JSON
Locate = Callable[[str, str], str]  # gives the Earth's field at a place on a day, in JSON


def load_session(path: str | Path, *, date: str | None = None) -> parts.Session:
    """Read a session; files that it names lie beside it, unless their paths are absolute.

    Parameters
    ----------
    path : path
        The session file.
    date : str, optional
        Day on which its bytes came, ISO 8601, for a place without a date; today for a line that is yet to run.

    Raises
    ------
    DecodeError
        If a file is missing or no TOML, or a key is unknown, missing or of the wrong type.
    ParameterError, UnitError, FrameError, CalibrationError
        If what it asks for does not exist or does not go together.
    """
    text = text_of(path)
    file = Path(path)
    with reading(file):
        return _rooted(file, parse_session(text, lambda name: text_of(file.parent / name), name=file.stem, date=date))


def _rooted(file: Path, session: parts.Session) -> parts.Session:
    """The session with the file of its bytes beside it, as every file that it names; what is written goes elsewhere."""
    source = session.source
    session = replace(session, beside=tuple(_rooted(file, other) for other in session.beside))
    if source is None or source.kind != "file":
        return session
    settings = {**source.settings, "path": str(file.parent / source.settings["path"])}
    return replace(session, source=replace(source, settings=settings))


def json_schema(kind: str) -> dict[str, Any]:
    """JSON Schema of a file in TOML, made of the parsers that read it; editors check with it what is typed.

    Parameters
    ----------
    kind : {"array", "chain", "format", "profile", "session"}
        What the file describes.

    Raises
    ------
    ShapeError
        If there is no such kind.
    """
    from plumbob.data.chain import CHAIN
    from plumbob.files.profile import PROFILE

    parsers = {"array": ARRAY, "chain": CHAIN, "format": FORMAT, "profile": PROFILE, "session": SESSION_FORM}
    parse = parsers[check.one_of("kind", kind, tuple(parsers))]
    title = {"$schema": "http://json-schema.org/draft-07/schema#", "title": f"plumbob {kind}"}
    return title | schema.json_schema(parse)


def recorded_session(texts: Mapping[str, str], name: str) -> parts.Session:
    """Session that a recording holds."""

    def fetch(wanted: str) -> str:
        if wanted not in texts:
            raise DecodeError(f"the recording does not hold {wanted}; it was not made by 'plumbob record'.")
        return texts[wanted]

    session = parse_session(
        fetch(SESSION), fetch, name=name, describe=lambda _: fetch(IIO), locate=lambda *_: fetch(PLACE), date=""
    )
    if POSE not in texts or session.chain is None:
        return session
    pose = schema.document(texts[POSE], GUIDE, schema.form(_POSED, _POSED))
    return replace(session, chain=replace(session.chain, **pose), texts={**session.texts, POSE: texts[POSE]})


def posed(session: parts.Session, angles: Floats, sd: float) -> parts.Session:
    """Session whose chain begins at these angles, rad, as one that goes on; a recording of it holds them."""
    assert session.chain is not None
    values = ", ".join(f'"{angle!r} rad"' for angle in angles.tolist())
    texts = {**session.texts, POSE: f'pose = [{values}]\npose_sd = "{sd!r} rad"\n'}
    return replace(session, chain=replace(session.chain, pose=tuple(angles.tolist()), pose_sd=sd), texts=texts)


def _field_at(place: str, date: str) -> str:
    return json.dumps(earth_field_at(*parse_place(place), date)._asdict())


def parse_session(
    text: str, fetch: Fetch, *, name: str, describe: Describe = described, locate: Locate = _field_at,
    date: str | None = None,
) -> parts.Session:  # fmt: skip
    """Session from TOML text, as `load_session`; `fetch` gives the text of each file that it names.

    `describe` gives what the kernel says of an IIO device, `locate` the field at a place; asked only where they are
    needed.
    """
    around = _Around({SESSION: text}, fetch, describe, locate, date)
    tables = schema.document(text, GUIDE, SESSION_FORM)
    sources = tables.get("source")
    first, *others = sources if isinstance(sources, tuple) else ({},)
    session, names = _session(tables | first, name, around), [str(other.get("name", "")) for other in others]
    units = [unit.unit for unit in session.units]
    for other, called in zip(others, names, strict=True):
        if not re.fullmatch("[A-Za-z0-9_-]+", called) or [*names, *units].count(called) > 1:
            raise DecodeError(
                f"each [[source]] behind the first needs a name of its own, as name = \"ahrs\", but one has '{called}'."
            )
        if other["source"].kind in KERNEL or "place" in other.get("imu", {}):
            raise DecodeError(f"{called}: a device of the kernel, and imu.place, belong to the first [[source]].")
    beside = tuple(_session(other, called, around) for other, called in zip(others, names, strict=True))
    session = replace(session, beside=beside)
    for spec in session.send:
        if spec.of not in session.sources:
            raise unknown_name("source", spec.of, names, of="send.of")
        parts.require_sent(session, spec)
    return session


class _Around(NamedTuple):
    """What gives that which a session names, as of `parse_session`; `texts` keeps every file."""

    texts: dict[str, str]
    fetch: Fetch
    describe: Describe
    locate: Locate
    date: str | None

    def keep(self, wanted: str) -> str:
        """Text of a file."""
        self.texts[wanted] = self.fetch(wanted)
        return self.texts[wanted]


def _session(tables: Mapping[str, Any], name: str, around: _Around) -> parts.Session:
    """Session of its tables, or of one of several sources."""
    texts, keep = around.texts, around.keep
    source: parts.SourceSpec | None = tables.get("source")
    if source is not None and source.kind in KERNEL:
        texts[IIO] = around.describe(source)
        source, form, timed_by = _kernel(source, tables, texts[IIO])
        message, unit, names = form.name, "", list[str]()
        if "unit" in tables:
            raise DecodeError(
                f"[[unit]] does not go with source.kind = '{source.kind}', which has one unit; leave it out."
            )
    else:
        form, message, unit, names = _format(tables, source, keep)
        timed_by = _timed_by(source, form, form.message(message))
        if source is not None and source.kind == "file" and not isinstance(form, LineFormat):
            source = replace(source, settings={**source.settings, "form": form, "message": message})
    imu = described_imu(form) | tables.get("imu", {})
    if "place" in imu or "date" in imu:
        texts[PLACE] = around.locate(*_place_and_day(imu, source, around.date))
        imu["declination"] = _declination(texts[PLACE])
    frame = imu.get("frame")
    meta = _meta(imu, source, form, message, unit)
    card_name = tables.get("calibration", {}).get("card")
    card = None if card_name is None else CalibrationCard.from_text(keep(card_name), card_name)
    _require_device(card, meta.device, "[imu] device or --device")
    units = _units(names, listed_units(tables.get("unit", []), keep), meta, form.message(message))
    for spec in units:
        if card is not None:
            raise ParameterError("[calibration] has the card of one unit; name those of several as card in [[unit]].")
        _require_device(spec.card, spec.meta.device, "device in [[unit]]")
    if units:
        meta, card = next((spec.meta, spec.card) for spec in units if spec.unit == unit)
    scheme = _scheme(tables, units)
    chain = None if "chain" not in tables else _chain(tables["chain"], frame, units, form.message(message), keep)
    stage = _stage(tables, scheme, frame, keep)
    return parts.Session(
        name=name,
        source=source,
        form=form,
        message=message,
        unit=unit,
        meta=meta,
        frame=frame,
        card=card,
        rates=_rates(tables, form.message(message), unit),
        stage=stage,
        reference=_reference(tables, form, form.message(message), frame, stage),
        record=tables.get("record"),
        output=tables.get("output", parts.OutputSpec()),
        send=tuple(tables.get("send", ())),
        timed_by=timed_by,
        texts=texts,
        units=units,
        scheme=scheme,
        chain=chain,
    )


def _rates(tables: Mapping[str, Any], message: Message, unit: str) -> parts.RateSpec | None:
    spec: parts.RateSpec | None = tables.get("rates")
    if spec is not None:
        spec.made()  # refuses what it cannot take, before the start
        if not any(f.triad == (f"{unit}.gyr" if unit else "gyr") for f in message.fields):
            raise ParameterError(f"[rates] filters rates, and message {message.name} has none; leave it out.")
    return spec


def _scheme(tables: Mapping[str, Any], units: Sequence[parts.UnitSpec]) -> str:
    scheme: str = tables.get("array", {}).get("scheme", "")
    if scheme and not units:
        raise ParameterError('[array] needs several units that are all decoded; give units = "all" in [format].')
    beside = ("rates", "estimate") if scheme in ARRAY_FILTERS else ("rates",) if scheme else ()
    if clash := next((name for name in beside if name in tables), ""):
        raise ParameterError(f"[{clash}] does not go with array.scheme = '{scheme}'; leave it out.")
    return scheme


def _chain(
    section: Mapping[str, Any], frame: Frame | None, units: Sequence[parts.UnitSpec], message: Message, keep: Fetch
) -> parts.ChainSpec:
    spec = parts.ChainSpec(text=keep(section["file"]), **section)
    if spec.button and spec.button not in (names := [f.name for f in message.fields]):
        raise unknown_name("field", spec.button, names, of="chain.button")
    spec.made(frame, [unit.unit for unit in units])  # refuses what does not fit, before the start
    return spec


def _require_device(card: CalibrationCard | None, device: str, where: str) -> None:
    if card is not None and card.device != device:
        raise ParameterError(
            f"the card is for device '{card.device}', but imu.device is '{device}'; use the card of this unit, or name "
            f"the unit that it is, as {where}."
        )


def _units(
    names: Sequence[str], tables: Mapping[str, MountedUnit], meta: ImuMeta, message: Message
) -> tuple[parts.UnitSpec, ...]:
    """Units that are decoded, with what their tables say of them."""
    specs, named = [], {unit_prefix(message, name): mounted for name, mounted in tables.items()}
    for name in names:
        mounted = named.get(name, MountedUnit(name))
        unit_meta = replace(meta, device=mounted.device or meta.device, **_ranges(message, name, meta.axes))
        specs.append(parts.UnitSpec(name, unit_meta, mounted.card, mounted.mount))
    return tuple(specs)


def _declination(field: str) -> float:
    """Declination, rad, that the text of a field says; a recording's may be damaged."""
    try:
        return float(json.loads(field)["declination"])
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise DecodeError(f"{PLACE} of the recording holds no declination; the file is damaged.") from error


def _place_and_day(imu: Mapping[str, Any], source: parts.SourceSpec | None, date: str | None) -> tuple[str, str]:
    """Where the line is, and on which day; only bytes that are yet to come are of today."""
    if "place" not in imu or "declination" in imu:
        raise DecodeError(
            "Give imu.place or imu.declination, not both: the place gives the declination."
            if "place" in imu
            else "imu.date is the day of imu.place, which is missing; add it, or leave imu.date out."
        )
    live = source is not None and source.kind != "file"
    today = datetime.now(UTC).date().isoformat() if live else None
    day = imu.get("date", today if date is None else date)
    if day is None:
        raise ParameterError(
            "imu.place needs a day, because the Earth's field changes from year to year and bytes in a file do not "
            "say when they came; give imu.date (--date) as YYYY-MM-DD."
        )
    return imu["place"], day


def of_unit(session: parts.Session, wanted: str) -> parts.Session:
    """Session of another unit in the same frames, by its name or number from 1; ``"all"``: of all, as it is else."""
    message = session.form.message(session.message)
    if wanted == ALL and session.units:
        return session
    if wanted == ALL and prefix_by_unit(message) != ("",):
        main = parts.UnitSpec(session.unit, session.meta, session.card)
        units = _units(prefix_by_unit(message), {}, session.meta, message)
        return replace(session, units=tuple(main if spec.unit == session.unit else spec for spec in units))
    unit = unit_prefix(message, wanted)
    if specs := [spec for spec in session.units if spec.unit == unit]:
        return replace(session, unit=unit, meta=specs[0].meta, card=specs[0].card)
    return replace(session, unit=unit, meta=replace(session.meta, **_ranges(message, unit, session.meta.axes)))


def _ranges(message: Message, unit: str, axes: str) -> dict[str, Any]:
    """Full scales of a unit's triads in body axes, by the names that the data have for them."""
    return {f"{name}_range": np.abs(in_body_axes(axes, case)) for name, case in full_scales(message, unit).items()}


def _kernel(source: parts.SourceSpec, tables: Mapping[str, Any], text: str) -> tuple[parts.SourceSpec, Format, str]:
    """Source that insists on what the kernel said, its format, and what tells its time."""
    from plumbob.live.transports.iio_layout import IioLayout, iio_format

    if "format" in tables:
        raise DecodeError(f"[format] does not go with source.kind = '{source.kind}': the kernel sets it; leave it out.")
    layout = IioLayout.from_json(text)
    settings = {**source.settings, "layout": layout}
    form = iio_format(layout, mounted=settings.pop("mount", True))
    timed_by = "poll" if source.kind == "iio-poll" else "kernel" if layout.clock == "monotonic" else "frames"
    return replace(source, settings=settings), form, timed_by


def _timed_by(source: parts.SourceSpec | None, form: Format, message: Message) -> str:
    """What tells the time of a source that is not the kernel's; a poll over SPI must give whole transfers."""
    if source is None:
        return "frames"
    settings = source.settings
    if settings.get("time", "count" if source.kind in ("file", "stdin") else "host") == "count":
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


def _format(
    tables: Mapping[str, Any], source: parts.SourceSpec | None, keep: Fetch
) -> tuple[Format, str, str, list[str]]:
    """Format, message, the unit to estimate, and the units to decode where these are several."""
    if source is not None and (lines := source.settings.get("lines")):
        if other := [table for table in ("format", "unit", "reference") if table in tables]:
            raise DecodeError(f"[{other[0]}] does not go with source.lines: the profile says it; leave it out.")
        text = line_format(parse_profile(keep(lines), origin=Path(lines).name), midway=source.kind == "serial")
        return text, text.messages[0].name, "", []
    if "format" not in tables:
        raise schema.absent("session", "format")
    section = tables["format"]
    if ("name" in section) == ("file" in section):
        raise DecodeError('format needs either the name of a known device or file = "my.toml".')
    form = find_format(section["name"]) if "name" in section else parse_format(keep(section["file"]))
    form = form.bind(section.get("options", {}))
    message = form.message(section.get("message", ""))
    listed = [unit_prefix(message, table["name"]) for table in tables.get("unit", [])]
    if "units" not in section and not listed:
        return form, message.name, unit_prefix(message, section.get("unit", "")), []
    if prefix_by_unit(message) == ("",):
        raise ParameterError(f"message {message.name} has one unit without a name; leave units and [[unit]] out.")
    names = list(dict.fromkeys(listed)) if "units" not in section else list(prefix_by_unit(message))
    unit = unit_prefix(message, section.get("unit", names[0] if names else ""))
    if unit not in names:
        raise ParameterError(f"format.unit is '{unit}', but the units of [[unit]] are {', '.join(names)}; name one.")
    return form, message.name, unit, names


def _meta(imu: Mapping[str, Any], source: parts.SourceSpec | None, form: Format, message: str, unit: str) -> ImuMeta:
    axes = imu.get("axes", "x y z")
    ranges = {} if source is not None and source.kind in KERNEL else _ranges(form.message(message), unit, axes)
    rate = None if source is None else source.settings.get("rate")
    said = dict(form.profile.meta) if isinstance(form, LineFormat) and form.profile else {}
    given = {
        "device": imu.get("device", form.name),
        "axes": axes,
        "frame": imu.get("frame"),
        "declination": imu.get("declination"),
        "rate_nominal": rate or form.framing.rate or said.get("rate_nominal"),
        "unit_check": False,  # the format says the units
        "t0_ns": 0,
    }
    return ImuMeta(**said | ranges | given)


def _reference(
    tables: Mapping[str, Any], form: Format, message: Message, frame: Frame | None, stage: Stage | None
) -> parts.ReferenceSpec | None:
    """Attitude that the device says; a message without a triad must have one, and nothing that estimates."""
    said = form.profile.reference if isinstance(form, LineFormat) and form.profile else None
    spec: parts.ReferenceSpec | None = None if said is None else parts.ReferenceSpec(said.north, frame=said.frame)
    spec = tables.get("reference", spec)
    if not prefix_by_unit(message) and (spec is None or stage is not None):
        raise ParameterError(
            f"message {message.name} carries no gyr, acc or mag, so there is nothing to estimate from. To keep the "
            "attitude that it says, leave the filter out, and give [reference] north (--north): what its heading "
            "counts from."
        )
    if spec is not None and spec.frame is None and not any(f.name.endswith("heading") for f in message.fields):
        spec = replace(spec, frame=frame)
    if spec is not None:
        parts.reference_names(spec, message)  # refuses what is not there
    return spec


def _stage(tables: Mapping[str, Any], scheme: str, frame: Frame | None, keep: Fetch) -> Stage | None:
    section: Mapping[str, Any] | None = {"filter": scheme} if scheme in ARRAY_FILTERS else tables.get("estimate")
    if section is None:
        return None
    frame = parts.needed_frame("[estimate]", frame)
    noise = NoiseCard.from_text(keep(section["noise"]), section["noise"]) if "noise" in section else None
    stage = Stage(section.get("filter", SMOOTHER), section.get("params", {}), noise=noise, init=section.get("init"))
    if stage.init == TRUTH_WORD and "reference" not in tables:
        raise ParameterError("estimate.init = 'truth' takes the first attitude of [reference], which is missing.")
    make_follower(stage, frame)  # refuses what it cannot take, before the start
    return stage


def capture_session(
    file: Path | None = None, *, port: str | None = None, capture: str | Path | None = None,
    iio: str | int | None = None, baud: int = 115200, rate: float | str | None = None, time: str | None = None,
    format: str | Path | None = None, profile: str | Path | None = None, unit: str | None = None,
    device: str | None = None, frame: Frame | str | None = None, north: North | str | None = None,
    place: str | None = None, date: str | None = None, filter: str | None = None, lag: float | str | None = None,
    params: Mapping[str, Any] | None = None, calibration: CalibrationCard | str | Path | None = None,
    noise: NoiseCard | str | Path | None = None, init: str | None = None,
) -> parts.Session:  # fmt: skip
    """Session of a file, or of a few words, as the options of the command line are.

    Parameters
    ----------
    file : path, optional
        Session file, which says everything but the line's own options; ``-`` is standard input, as a port.
    port, capture, iio : optional
        Without a file one of these: a serial line, or ``-`` for standard input; raw bytes in a file (``--from``); an
        IIO device.
    baud : int
        Speed of `port`.
    rate : float or str, optional
        Frames per second of `port` or `capture`, Hz, where the format has neither clock nor rate.
    time : {"host", "count"}, optional
        What times the frames of `port`.
    format : str or path, optional
        What the bytes mean: a device, a rig or a format file.
    profile : str or path, optional
        What lines of text mean, instead of `format`: a profile, as `plumbob.profile` drafts one.
    unit : str, optional
        Which unit, where a frame has several; ``"all"`` decodes and records all, and estimates the first.
    device : str, optional
        Name of this unit, to which its calibration card belongs.
    frame : Frame or str, optional
        Navigation frame.
    north : North or str, optional
        What the heading counts from in the attitude that a device says itself, which is then kept.
    place, date : str, optional
        As in `plumbob.estimate`.
    filter, lag, params, calibration, noise, init : optional
        As in `plumbob.estimate`, but the smoother has no lag by default; nothing is estimated without `filter`, `lag`,
        `params`, `noise` or `init`.

    Raises
    ------
    ParameterError
        If not exactly one line is named, or options do not fit it.
    PlumbobError
        As in `load_session`.
    """
    cards = {"calibration": calibration, "noise": noise}
    imu = {"device": device, "frame": frame and str(frame), "place": place, "date": date}
    tables: dict[str, Mapping[str, Any]] = _estimate_table(*lagged(filter, lag, params), init, noise)
    if calibration is not None:
        tables["calibration"] = {"card": _card_name("calibration", calibration)}
    if imu_table := {key: value for key, value in imu.items() if value}:
        tables["imu"] = imu_table
    if north:
        tables["reference"] = {"north": str(north)}
    if unit:
        tables["format"] = {"units": ALL} if unit == ALL else {"unit": unit}
    if str(file) == STDIN:
        file, port = None, port or STDIN
    if [file, port, capture, iio].count(None) != 3:
        raise ParameterError("give either a session file, or --port or --from with --format or --profile, or --iio.")
    if file is not None:
        if format or profile or tables:
            raise ParameterError(
                "the session file already sets format, unit, device, frame, calibration and filter; leave these "
                "options out."
            )
        return load_session(file)
    if iio is not None and (format or profile or unit):
        raise ParameterError("--iio takes no --format and no --unit: the kernel says what the bytes mean.")
    if iio is None and (format is None) == (profile is None):
        raise ParameterError(
            "--port and --from need --format, or --profile for lines of text: what the bytes mean is not guessed; see "
            "'plumbob list devices', and 'plumbob profile PORT', which drafts a profile."
        )
    source = _source_table(port, capture, iio, baud=baud, rate=rate, time=time)
    source |= {} if profile is None else {"lines": str(profile)}
    held = {_card_name(key, card): card.text() for key, card in cards.items() if isinstance(card, Card)}
    return parse_session(
        plain_session(form=None if format is None else str(format), source=source, **tables),
        lambda name: held[name] if name in held else text_of(Path(name)),
        name=Path(str(port or capture or iio)).name,
    )


def _source_table(
    port: str | None, capture: str | Path | None, iio: str | int | None, *, baud: int, rate: float | str | None,
    time: str | None,
) -> dict[str, Any]:  # fmt: skip
    if iio is not None:
        return {"kind": "iio", "device": int(iio) if str(iio).isdecimal() else iio}
    paced = {"rate": f"{rate!r} Hz" if isinstance(rate, int | float) else rate} if rate else {}
    if capture is not None:
        return {"kind": "file", "path": str(capture), **paced}
    line: dict[str, Any] = {"kind": "stdin"} if port == STDIN else {"kind": "serial", "port": port, "baud": baud}
    line = {"kind": "websocket", "url": port} if str(port).startswith("ws:") else line
    return line | paced | ({"time": time} if time else {})


def _estimate_table(
    filter: str | None, params: Mapping[str, Any] | None, init: str | None, noise: Any
) -> dict[str, Mapping[str, Any]]:
    """Table of a filter; numbers are in SI, and say so in the text of the session."""
    if filter is None and not (params or noise or init):
        return {}
    filter = filter or SMOOTHER
    quantities = {p.name: p.spec.quantity for kind in (load(filter).Params, CommonParams) for p in describe(kind)}
    table: dict[str, Any] = {"filter": filter}
    if params:
        table["params"] = {key: _with_unit(value, quantities.get(key, Quantity.RATIO)) for key, value in params.items()}
    if noise is not None:
        table["noise"] = _card_name("noise", noise)
    return {"estimate": table | ({"init": init} if init else {})}


def _with_unit(value: Any, quantity: Quantity) -> Any:
    """A number in SI with its unit; a switch or an absent value as a word."""
    if value is None or isinstance(value, bool):
        return "on" if value else "off"
    return f"{value!r} {quantity.value}" if isinstance(value, int | float) and quantity is not Quantity.RATIO else value


def _card_name(key: str, card: Card | str | Path) -> str:
    """Name of a card's file; one that has none gets that of its part in the session."""
    return f"{key}.json" if isinstance(card, Card) else str(card)


def plain_session(*, form: str | None, source: Mapping[str, Any], **tables: Mapping[str, Any]) -> str:
    """Text of a session of a catalogued format, a format file or none, as the command line makes one of its options."""
    content: dict[str, Mapping[str, Any]] = {"source": source, **tables}
    if form is not None:
        named = {"file": form} if form.endswith(".toml") else {"name": form}
        content["format"] = {**named, **tables.get("format", {})}
    lines = [f'kind = "{KIND}"', f"version = {VERSION}"]
    for name, table in content.items():
        lines += ["", f"[{name}]", *(f"{toml_text(key)} = {toml_value(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _axes(words: str) -> str:
    body_axes(words)
    return words


_POSE: Final = schema.either(list, schema.listed(schema.quantity(Quantity.ANGLE), of="angles"), schema.one_of("zero"))
_PARAMS: Final = schema.mapping(parts.parameter)
_POSED: Final = {"pose": _POSE, "pose_sd": schema.size(Quantity.ANGLE)}
_CHAIN: Final = {**_POSED, "params": _PARAMS, **dict.fromkeys(("file", "button"), schema.text)}
_WORDS: Final = dict.fromkeys(("name", "file", "message"), schema.text)
_UNIT_NAME: Final = schema.either(int, schema.converted(str, schema.whole(1)), schema.text)
_FORMAT: Final = {**_WORDS, "unit": _UNIT_NAME, "units": schema.one_of(ALL), "options": schema.mapping(schema.text)}
_IMU: Final = {
    **dict.fromkeys(("device", "place", "date"), schema.text),
    "axes": schema.converted(_axes),
    "frame": schema.converted(Frame.parse),
    "declination": schema.quantity(Quantity.ANGLE),
}


def parse_source(where: str, value: Any) -> parts.SourceSpec:
    """Source from its table."""
    kind = _KIND(f"{where}.kind", _TABLE(where, value).get("kind"))
    settings: dict[str, Any] = _SOURCES[kind](where, value)
    return parts.SourceSpec(settings.pop("kind"), settings)


def _one_of_several(where: str, value: Any) -> dict[str, Any]:
    """Source with what its bytes mean, by the keys of a session."""
    table = _TABLE(where, value)
    meaning = _BESIDE(where, {key: part for key, part in table.items() if key in _OF_SOURCE})
    line = {key: part for key, part in table.items() if key not in meaning}
    return {**meaning, "source": parse_source(where, line)}


def _step(where: str, value: Any) -> bytes | float:
    """Command, or time to wait, s."""
    words = schema.text(where, value)
    try:
        return units.parse(words, Quantity.TIME) if units.split(words)[1] else HEX(where, words)
    except UnitError:
        return HEX(where, words)  # type: ignore[no-any-return]


_PORT: Final = schema.whole(1, 65535)
_RATE: Final = schema.size(Quantity.FREQUENCY)
_COUNT: Final = schema.whole(1)
_LINES: Final = {"lines": schema.text}
_STREAM: Final = {"gather": schema.size(Quantity.TIME), "speed": schema.positive, "rate": _RATE, **_LINES}
_PATIENT: Final = {**_STREAM, "time": schema.one_of("host", "count")}
"""Of streams whose sender waits for a reader that is late; datagrams are lost instead."""
_IIO: Final = {
    "device": schema.either(int, schema.whole(0), schema.text),
    "channels": schema.texts,
    "rate": _RATE,
    "mount": schema.truth,
    "sys_root": schema.text,
}
_BUFFER: Final = {"trigger": schema.text, "length": _COUNT, "watermark": _COUNT, "dev_root": schema.text}
_SPI: Final = {
    "bus": schema.whole(0),
    "device": schema.whole(0),
    "mode": schema.whole(0, 3),
    "hz": _COUNT,
    "rate": _RATE,
    "exchange": schema.listed(HEX, of="commands"),
}
_START: Final = schema.listed(schema.described(_step, type="string"), of="commands and times")
_KEYS: Final[Mapping[str, tuple[dict[str, Parse], Collection[str]]]] = {
    "serial": ({"port": schema.text, "baud": _COUNT, "wait": schema.truth, **_PATIENT}, ("port", "baud")),
    "udp": ({"host": schema.text, "port": _PORT, **_STREAM}, ("port",)),
    "file": ({"path": schema.text, "rate": _RATE, **_LINES}, ("path",)),
    "stdin": ({key: parse for key, parse in _PATIENT.items() if key != "gather"}, ()),
    "websocket": ({"url": schema.text, **_PATIENT}, ("url",)),
    "tcp": ({"host": schema.text, "port": _PORT, **_PATIENT}, ("host", "port")),
    "iio": (_IIO | _BUFFER, ("device",)),
    "iio-poll": (_IIO, ("device", "rate")),
    "spi": (_SPI | {"skip": schema.whole(0), "start": _START}, _SPI),
}
_SOURCES: Final = {
    kind: schema.form({"kind": schema.one_of(kind), **keys}, ("kind", *required))
    for kind, (keys, required) in _KEYS.items()
}
_TABLE: Final = schema.mapping(schema.anything)
_KIND: Final = schema.one_of(*_SOURCES)
schema.described(parse_source, anyOf=[schema.json_schema(parse) for parse in _SOURCES.values()])


_OF_SOURCE: Final[dict[str, Parse]] = {
    "name": schema.text,
    "format": schema.form(_FORMAT),
    "imu": schema.form(_IMU),
    "calibration": schema.form({"card": schema.text}, ("card",)),
    "estimate": schema.form({"params": _PARAMS, **dict.fromkeys(("filter", "noise", "init"), schema.text)}),
    "reference": schema.table(parts.ReferenceSpec, frame=schema.converted(Frame.parse)),
}
"""What the bytes of a source mean, beside them or in the session's own tables."""
_BESIDE: Final = schema.form(_OF_SOURCE)
schema.described(
    _one_of_several,
    anyOf=[schema.json_schema(schema.form({"kind": schema.one_of(kind), **keys, **_OF_SOURCE}, ("kind", *required)))
           for kind, (keys, required) in _KEYS.items()],
)  # fmt: skip


SESSION_FORM: Final = schema.form(
    {
        "kind": schema.one_of(KIND),
        "version": schema.version(VERSION),
        "source": schema.either(list, schema.tables(_one_of_several), parse_source),
        **{key: parse for key, parse in _OF_SOURCE.items() if key != "name"},
        "unit": schema.tables(UNIT),
        "rates": schema.table(parts.RateSpec),
        "array": schema.form({"scheme": schema.one_of(*ARRAY_SCHEMES)}, ("scheme",)),
        "chain": schema.form(_CHAIN, ("file",)),
        "record": schema.table(parts.RecordSpec),
        "output": schema.table(parts.OutputSpec),
        "send": schema.tables(parts.SEND_TABLE),
    },
    ("kind", "version"),
    name="session",
)
"""Parser of a session's outermost table."""
