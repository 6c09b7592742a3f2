"""The verbs, in the groups and the order of ``plumbob --help``, with what their functions do not say of them."""

from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from plumbob.cli.common import PARAMS_HELP
from plumbob.cli.engine import VERB_BY_FUNCTION, Verb, save

DIFFERENT: Final = 3  # exit code of a result that is damaged, lossy, different, unproven or below a grade
_ESTIMATE: Final = (("filter", "causal", "lag"),)


def arm_page(motion: Any, _args: Namespace) -> Any:
    """Page of estimated joint angles."""
    from plumbob.reporting.arm import arm_report

    facts = [(name, value) for name, value in motion.facts().items() if name in ("frame", "method")]
    return arm_report(
        motion.chain, motion.joints, postures=motion.postures(), facts=facts, remarks=motion.notes,
        title=motion.chain.name, strides=motion.strides,
    )  # fmt: skip


def save_recording(replayed: Any, path: Path, args: Namespace) -> None:
    """Write the track of a replay."""
    from dataclasses import replace

    from plumbob.live.recorded import convert

    convert(replace(replayed.as_recording(), name=path.stem), path, overwrite=args.force)


def save_virtual(virtual: Any, path: Path, args: Namespace) -> None:
    """Write the virtual unit of an array."""
    from plumbob.data.recording import Recording
    from plumbob.live.recorded import convert

    note = f"virtual unit of the array in {', '.join(Path(file).name for file in args.array)}"
    convert(Recording(imu=virtual.imu, name=path.stem, notes=(note,)), path, overwrite=args.force)


def _write_hand(replay: Any, path: Path, args: Namespace) -> None:
    from plumbob.arm.angles import write_table

    write_table(path, replay.columns(), source=f"{Path(args.model).name} moved", overwrite=args.force)


def _write_strides(motion: Any, path: Path, args: Namespace) -> None:
    motion.save_strides(path, overwrite=args.force)


def _write_card(motion: Any, path: Path, args: Namespace) -> None:
    motion.card.save(path, overwrite=args.force)


_LINE: Final = ("file", "capture", "date", "filter", "lag", "params", "noise", "init", "frame")
_GUIDE: Final = {
    "guide": ("", "print how the capture went, and what it lacks"),
    "live": ("", "calibrate while the unit is moved, with instructions: a session file, or --port, --from, --iio"),
    "raw": ("MCAP", "with --live: recording of the capture, raw bytes and samples"),
}
OF_LINES: Final = ("port", "iio", "format", "baud", "rate", "time", "unit")  # that name the line of --live
_ONE_OF: Final = {"mag": (("strength", "place"),), "hand": (("strength", "place"),), "table": (("rates", "plan"),)}


def _calibrate(
    kind: str,
    line: str,
    example: str = "",
    note: str = "",
    also: tuple[str, ...] = (),
    more: Mapping[str, tuple[str, str]] = {},
) -> Verb:
    guided = kind in ("mag", "accel", "gyro")
    if kind in ("mag", "accel"):
        more = {
            **more,
            "counts": ("", "the file holds bare triples in counts: no time, unit or rate; no card is made"),
            "as": ("FORM", "paste with --counts: c, arduino, magneto, motioncal, ardupilot, px4, betaflight, json"),
            "scale": ("LSB", "with --counts: what one count is, as '0.15 uT', which flight controllers need"),
        }
    line_only = (*_LINE, *(() if kind == "mag" else ("place",))) if guided else ()
    functions = also or (f"door.calibrate._{kind}",)
    out = {"out": ("JSON", "card to write; that of --calibration is completed")}
    return Verb(
        line, "calibration.md", f"plumbob calibrate {kind} capture.parquet{example} --out card.json", "calibrate",
        also=(*functions, *(("live.session_toml.capture_session",) if guided else ())), run="calibrate.calibrate",
        brought=("live", *OF_LINES) if guided else (),
        hidden=("kind", "labels", "force", *line_only), outputs=(), note=note,
        optional=("recording",) if guided else (),
        pages=lambda calibrated, args: calibrated.report(recording=args.file.name if args.file else "live"),
        needs={**dict.fromkeys(("raw", *OF_LINES), ("live",)), **dict.fromkeys(("as", "scale"), ("counts",))}
        if guided else {},
        apart={
            "counts": ("live", "guide", "calibration", "device", "start", "stop", "profile", "with_", "shape", "place",
                       "tilt", "in_use", "moving", "gravity", "latitude", "height", "out", "html", "plot"),
            "live": ("profile", "stop"), "in_use": ("live",), "preset": ("method",), "parts": ("part_column",),
            "part_column": ("start", "stop"),
        },
        exclusive=_ONE_OF.get(kind, ()), more={**out, **(_GUIDE if guided else {}), **more},
    )  # fmt: skip


_COEFFICIENTS: Final = ("card", "device", "methods", "curve", "as")  # which allan without coefficients lacks
START: Final = {
    "profile": Verb(
        "draft the profile of a logger's CSV or text file, with a question for every guess",
        "own-csv.md", "plumbob profile log.csv --accept --set frame=ENU", run="profile", outputs=(),
        repeat=("answers",),
    ),
    "doctor": Verb(
        "check units, axes, signs and delays of the sensors by the motion itself, with odds",
        "doctor.md", "plumbob doctor log.csv --profile logger.toml --hemisphere north",
        code=lambda diagnosis: DIFFERENT if diagnosis.wrong else 0,
    ),
    "calibrate": Verb(
        "calibrate a unit from a capture by hand or in the laboratory",
        "calibration.md", "plumbob calibrate hand capture.parquet --out card.json",
        note="A card grows: --calibration card.json applies what is known so far to the other triads, and --out gets "
        "it with the new part added. Captures that cannot calibrate anything are refused with the reason, exit code 1, "
        "and no card is written.",
        kinds={
            "hand": _calibrate(
                "hand", "the whole unit: accelerometer, gyroscope and magnetometer from one capture by hand",
                " --html card.html", "Away from iron, hold the unit still for 3 s in each of 18 poses, every face and "
                "every edge of its case once up, or in 40 any; turn it within a second or two in between, by a quarter "
                "or half a turn about another axis each time. If one sensor cannot be calibrated, no card is written.",
            ),
            "mag": _calibrate(
                "mag", "magnetometer: hard iron, soft iron, scale, turn against the accelerometer", "",
                "Turn the unit slowly through all attitudes, away from iron: each face and each edge once up. A card "
                "that would more likely harm than help is refused; --force writes it anyway.",
            ),
            "accel": _calibrate(
                "accel", "accelerometer: bias, scale and misalignment from poses at rest", "",
                "Hold the unit still for 2 s or more in each of 18 poses, or in 40 any: every face and every edge of "
                "its case once up. Six faces give bias and scale only. With --moving, turn it slowly (20 to 30 deg/s) "
                "about all its axes for two minutes, close to the wrist.",
            ),
            "gyro": _calibrate(
                "gyro", "gyroscope: bias, scale and axes, without a table", " --method rest",
                "rest: 30 s at rest, for the bias.\n"
                "hand: 30 s at rest, then 20 quarter or half turns about all axes, each with 2 s of rest after it; "
                "--calibration gives the accelerometer's card.\n"
                "stops, without an accelerometer: 10 s at rest, then turns by --angle against a stop, two about each "
                "axis, each with 3 s of rest after it, as of a box over its edges; or what --turns names.\n"
                "ferraris: six faces at rest (x_p x_a ... z_a: axis up, axis down) and a turn by --angle about each "
                "axis (x_rot y_rot z_rot); the parts are looked for, or named by --parts or --part-column.",
                ("door.calibrate._gyro", "door.calibrate._ferraris"),
                {"part_column": ("NAME", "column of a text file that names the parts")},
            ),
            "table": _calibrate("table", "gyroscope on a rate table: bias, scale, misalignment, g-sensitivity",
                                " --rates '50,100,200 deg/s'"),
            "temperature": _calibrate(
                "temperature", "bias of one sensor over temperature, from a soak at rest", "",
                "Let the unit lie still while it warms up and cools down again, over 10 K or more in half an hour or "
                "longer, and record its temperature. --triad acc or mag completes the part that --calibration has.",
            ),
            "currents": _calibrate(
                "currents", "field of motors and wires: what throttle, current or speed adds to the magnetometer",
                " --current throttle --calibration card.json",
                "Record while the load rises and falls several times, at rest or while moving; name its columns. The "
                "card then takes the field off in every file that has these columns, or says why it cannot.",
            ),
            "mount": _calibrate(
                "mount", "how the unit sits on its body, from two poses at rest or a reference", " --frame NED",
                "Rest with the body level, raise its nose by 15° to 60° about the lateral axis, and rest again; or "
                "compare with a reference attitude.",
            ),
            "statictest": Verb(
                "errors at rest against a reference, before and after a card; writes no card",
                "calibration.md",
                "plumbob calibrate statictest table36.parquet --calibration card.json --html statictest.html",
                "papers.static_test.static_test", run="calibrate.tested", outputs=(), pages=lambda *_: None,
            ),
        },
    ),
    "run": Verb(
        "estimate the attitude of a recording",
        "choose-a-filter.md", "plumbob run sea.parquet --out track.parquet", "estimate", run="run",
        named=("filter",), outputs=("out", "card", "report", "acceleration", "heave"), exclusive=_ESTIMATE,
        writes={
            "out": ("written", None), "report": ("page", None),
            "card": ("card", lambda estimate, path, args: save(estimate.card(), path, args)),
            "acceleration": (
                "acceleration",
                lambda run, path, args: save(run.acceleration(noise=getattr(args, "noise", None)), path, args),
            ),
            "heave": ("heave", lambda run, path, args: save(run.acceleration().displacement(), path, args)),
        },
        ends={"report": (".html", ".htm"), "acceleration": (".csv", ".parquet"), "heave": (".csv", ".parquet")},
        more={
            "drift": ("MODEL", "subtracted before a filter of rates: chen2013, the trackball paper's figures"),
            "rest": ("A..B", "before a filter of rates: take the mean of this stretch off, as 0s..100s"),
            "card": ("FILE", "where to write the card with what was found of the gyroscope"),
            "report": ("HTML", "also write a page about it, as 'plumbob report' does, of this estimate"),
            "acceleration": ("FILE", "also write the acceleration without gravity in earth axes, with its deviation"),
            "heave": ("FILE", "also write the way of what floats, up and level, in waves of 1 to 20 s"),
        },
        note="A filter of rates (scalar, two_state, moving_average) gives no attitude: --out is then the recording "
        "with its rates filtered.",
    ),
    "report": Verb(
        "one page about recordings, or one figure for a paper: attitude, tilt statistics, spectra, gaps, quality",
        "report.md", "plumbob report sea.parquet --out sea.html", run="report", outputs=("out", "pdf"),
        writes={"out": ("page", None), "pdf": ("pdf", None)},
        also=("plot",), hidden=("what",), exclusive=_ESTIMATE, ends={"pdf": (".pdf",)},
        needs={"lang": ("out", "pdf"), **dict.fromkeys(("begin", "end", "width"), ("figure",))},
        apart={"figure": ("pdf", "json")},
        more={
            "figure": ("NAME", "draw this figure alone into --out, a .svg, .pdf or .png: angles, tilt, rates, forces, "
                     "field, temperature, bias, sd, spectrum, rose, bursts, flags; of what floats waves, "
                     "wavespectrum or waverose"),
        },
        note="plumbob report sea.parquet --figure spectrum --width 85mm --out spectrum.pdf draws one figure.",
    ),
    "record": Verb(
        "record a live line, and estimate its attitude as it comes",
        "record-at-sea.md", "plumbob record --port /dev/ttyUSB0 --format buoy --device buoy-7 --out sea.mcap",
        also=("live.session_toml.capture_session",), hidden=("file",), repeat=("send",), run="record", outputs=(),
        note="Exit code 3 where rows of the recording are lost or its text is cut short, as on a full disk. For a "
        "recorder that nobody attends, see 'Unattended' in docs/sessions.md.",
    ),
    "view": Verb(
        "show a live line, or play a recording, on a page in a browser, or as text in a terminal",
        "view.md", "plumbob view --emulate buoy", also=("live.session_toml.capture_session", "estimate"),
        hidden=("file", "out", "overwrite", "open_browser"), repeat=("send", "allow_origin"), run="view", outputs=(),
        more={"no_open": ("", "do not open a browser")},
        note="Exit code 3 where rows of a recording are lost. The page's address holds a token. End it with Ctrl-C or "
        "SIGTERM; a recording that is being made ends whole.",
    ),
    "allan": Verb(
        "analyse the noise of a sensor at rest: Allan deviation, coefficients of a data sheet, noise card",
        "noise.md", "plumbob allan static.parquet --html noise.html --card noise.json", run="allan",
        outputs=("card",), pages=lambda noise, args: noise.report(**({} if noise.beside else {"device": args.device})),
        details=("methods", "curve"),
        writes={"card": ("card", lambda noise, path, args: save(noise.card(args.device), path, args))},
        needs={"device": ("card", "html")},
        apart={
            "deviation": (*_COEFFICIENTS, "html", "plot"),
            "as": ("json", "methods", "curve", "html", "plot", "card"),
        },
        more={
            "deviation": ("KIND", "print this deviation alone, without coefficients: oadev, adev, mdev, ohdev, ..."),
            "methods": ("", "show the three methods side by side"),
            "curve": ("", "show the deviation itself, by averaging time"),
            "card": ("JSON", "also write a noise card for the simulator and filters"),
            "as": ("FORM", "print what another program takes: kalibr, vins, orbslam, liosam, kfgins, ros"),
            "device": ("NAME", "the unit's name on card and page (default: the file's)"),
        },
        note="A recording brings its time and units. Plain numbers (text, .npy, or raw .f32, .f64, .i16, ...) need "
        "--rate and --scale; nothing is guessed:\n"
        "  plumbob allan gyro.txt --rate 100Hz --scale '0.00875 deg/s'    counts of 0.00875 deg/s\n"
        "  plumbob allan a.parquet b.parquet c.parquet --plot units.pdf    units beside each other\n"
        "  plumbob allan raw.txt filtered.txt --rate 10Hz --scale '1 deg/s'    before and after a filter\n"
        "  plumbob allan rest.parquet rest.parquet --calibration none card.json    before and after a card",
    ),
    "waves": Verb(
        "height, period and direction of waves by burst, of something that floats, as NetCDF, CSV or Parquet",
        "waves.md", "plumbob waves sea.parquet --out waves.nc", run="batch",
        ends={"out": (".nc", ".csv", ".parquet")},
        more={"high": ("HZ", "highest frequency of waves that count (default 1 Hz)")},
    ),
    "batch": Verb(
        "estimate the attitude of many recordings: one dataset, and a table of verdicts",
        "fleet.md", "plumbob batch recordings --filter mekf --out dataset", run="batch", named=("out",), outputs=(),
        exclusive=(*_ESTIMATE, ("jobs", "cluster")),
        note="Exit code 3 where some recordings are damaged or refused.",
        code=lambda done: 0 if done.counts["done"] == done.recordings else DIFFERENT,
    ),
}  # fmt: skip
LINES: Final = {
    "start": Verb(
        "write the session of one of the papers' systems, or of a board that prints text, with next steps",
        "sessions.md", "plumbob start buoy my-buoy --port /dev/ttyUSB0", "reporting.catalogue.start", outputs=(),
    ),
    "emulate": Verb(
        "emulate a rig: its bytes over a pseudo-terminal, a socket or into a file",
        "acquire.md", "plumbob emulate buoy --link buoy-port --duration 60s --truth truth.parquet", run="emulate",
        repeat=("noise", "options"), outputs=(), json=False, exclusive=(("link", "tcp", "udp", "write"),),
    ),
    "control": Verb(
        "ask a running view for something: record, stop, mark, tare, seek, calibrate",
        "view.md", "plumbob control 'http://127.0.0.1:8770/?token=...' mark 'lee of the pier'", run="control",
    ),
    "replay": Verb(
        "process a recorded line again, with its own filter or another",
        "recordings.md", "plumbob replay sea.mcap --filter vqf --out vqf.parquet", repeat=("send",), run="replay",
        writes={"out": ("written", save_recording)},
        more={"out": ("FILE", "where to write the track (.parquet, .csv or .tum)")},
        code=lambda result: 0 if result.comparison is None or result.comparison.equal else DIFFERENT,
    ),
    "send": Verb(
        "send the attitude of a file to another program, ship or aircraft",
        "send.md", "plumbob send track.parquet --as nmea --to udp:127.0.0.1:10110 --rate 10Hz --sentences HDT,PASHR",
        named=("form", "to"), run="send",
    ),
    "decode": Verb(
        "decode bytes of a known device or a described frame to a table with units",
        "formats.md", "plumbob decode raw.bin --format buoy --out table.csv", named=("format",),
        hidden=("t_ns", "each"), repeat=("options",), outputs=(), run="decode_bytes", json=False,
        ends={"out": (".csv", ".txt", ".parquet", ".json")},
        more={
            "data": ("", "raw bytes, as a device sent them; '-' for standard input"),
            "ring": ("", "the file is a log written round and round: its frames by their counter"),
            "message": ("M", "which kind of frame (default the first that occurs)"),
            "rate": ("HZ", "frames per second: adds a column of time, counted from the first frame"),
            "out": ("TABLE", "write .csv, .txt, .parquet or .json instead of printing CSV"),
            "unit": ("U", "which of several units in a frame the file is read as (default the first)"),
        },
    ),
}  # fmt: skip
FILES: Final = {
    "info": Verb(
        "show what a recording, track or card holds: time, units, frames, flags; calibration; noise; a grade",
        "info.md", "plumbob info sea.mcap --min-grade 70", run="info", exclusive=(("min_grade", "require"),),
        details=("grade",),
        more={
            "min_grade": ("GRADE", "exit code 3 below this grade, 0 to 100"),
            "require": ("GOOD|FAIR|POOR", "exit code 3 where the grade is worse"),
            "grade": ("", "every criterion with its measurement, points, rule and advice"),
        },
    ),
    "convert": Verb(
        "write a recording of any format as CSV, Parquet, MATLAB, NetCDF, MCAP, TUM, text, or for ROS and EuRoC",
        "file-formats.md", "plumbob convert sea.mcap sea.csv", run="convert", outputs=(), json=False,
    ),
    "verify": Verb(
        "check that every row of an MCAP recording is there and undamaged, and save its intact rows",
        "recordings.md", "plumbob verify sea.mcap --repair whole.mcap", run="verify", outputs=("repair",),
        more={"repair": ("MCAP", "also write every intact row to this new, complete file")},
        note="Exit code 3 where it is damaged or not complete, or rows are lost.",
    ),
    "compare": Verb(
        "compare two recordings of one motion, or two attitudes: clocks, mounting, biases, what differs",
        "compare.md", "plumbob compare left.parquet right.parquet --tolerance 1%",
        pages=lambda comparison, args: comparison.report(),
        note="Exit code 3 where they differ by more than --tolerance.",
        code=lambda comparison: DIFFERENT if comparison.within is False else 0,
    ),
}  # fmt: skip
_SETTINGS: Final = ("strength", "dip", "declination", "temp_c", "mag_rate", "jitter", "lost")
_SCENARIO: Final = {"set": ("P", f"name=value,... with units: the scenario's parameters, and {', '.join(_SETTINGS)}")}
CHANGES: Final = {  # as `plumbob.fleet.experiments.variants.changed` knows them: letter of the value, help
    "start": ("S", "begin this long after the motion begins, as 20s"),
    "wrong_field": (
        "F:S-S", "add a field in the reference's frame for a time, as 15,-10,20uT:0s-20s; ...@motion counts from the "
        "start of the motion; several with ;",
    ),
    "hard_iron": ("F", "add a field in body axes, as 5,0,0uT"),
    "scale": ("R", "make rates too large, as 1%%"),
    "bias": ("R", "add a rate, on all axes or each, as 6dps or 2,-2,2dps"),
    "no_mag": ("", "leave out the magnetometer"),
    "gaps": ("NxS", "remove the samples of N stretches in motion, as 5x1s"),
    "rate": ("HZ", "means of whole blocks, as 47.6Hz"),
    "asynchronous": ("", "rates, specific forces and fields in different rows"),
    "missing": ("R", "rows without values, as 5%%"),
}  # fmt: skip
_FILTERS: Final = {
    "filters": ("A,B!", "see 'plumbob list filters'"),
    "params": ("P", f"{PARAMS_HELP}; with several filters write filter.name=value"),
}
JUDGE: Final = {
    "sim": Verb(
        "simulate a recording with its truth",
        "start.md", "plumbob sim buoy --frame NED --duration 60s --out sea.parquet", "simulate",
        hidden=(*_SETTINGS, "parameters"), optional=("frame", "unit"), outputs=(), run="scenarios.sim", json=False,
        more={
            **_SCENARIO,
            "chain": ("NAME|TOML", "chain that a program moves (default, of teach: teach)"),
            "out": ("FILE!", "recording to write (.parquet or .csv)"),
            "card": ("JSON", "write the unit's calibration card too"),
            "noise_card": ("JSON", "write the unit's noise card too"),
        },
    ),
    "eval": Verb(
        "compare an estimate with a reference: errors of attitude, by axis",
        "start.md", "plumbob eval track.parquet sea.parquet --settle 30s --html errors.html", "evaluate",
        pages=lambda evaluation, args: evaluation.report(
            facts=[("files", ", ".join(Path(file).name for file in (args.estimate, args.reference)))]
        ),
    ),
    "benchmark": Verb(
        "compare filters on many recordings, or on many seeds of a scenario, and fit their parameters",
        "choose-a-filter.md", "plumbob benchmark accuracy trials --filters mahony,vqf",
        kinds={
            "accuracy": Verb(
                "errors on every recording of some folders, and their means",
                "accuracy.md",
                "plumbob benchmark accuracy trials --filters smoother --peers vqf --against smoother --gaps 5x1s",
                "fleet.experiments.trials.measure_accuracy", run="scenarios.accuracy", outputs=(),
                hidden=("stages", "peers", "absent", "changes"),
                more={
                    **_FILTERS,
                    "noise": ("JSON", "noise card of the unit, for filters that take one"),
                    "peers": ("A,B", "vqf, imufusion, ahrs, single ones as vqf.offlineVQF, all or none (default none); "
                              "ahrs takes a second for 5000 samples"),
                    **CHANGES,
                },
                note="The options from --start on change every recording before anything runs.",
            ),
            "scenario": Verb(
                "errors per axis over many seeds of a simulated scenario",
                "choose-a-filter.md",
                "plumbob benchmark scenario buoy --frame NED --filters mahony,mekf --seeds 20",
                "fleet.experiments.scenario.measure_scenario", run="scenarios.scenario", outputs=(),
                hidden=("stages", "seeds", "seed", "settings", "own_noise", "noise", "warm_up", *_SETTINGS),
                optional=("frame", "sensors", "unit"), also=("simulate",),
                more={
                    **_SCENARIO, **_FILTERS,
                    "noise": ("JSON|own", "noise card for filters that take one; own: of the simulated unit"),
                    "seeds": ("N", "number of seeds, from 0 (default 20)"),
                },
            ),
            "tune": Verb(
                "fit parameters of a filter to recordings with references, cross-validated",
                "tune.md", "plumbob benchmark tune trials --filter mahony --params kp,ki --out mahony.toml", "tune",
                named=("filter",), run="scenarios.tune", pages=lambda tuning, args: tuning.report(),
                ends={"out": (".toml",)},
                more={
                    "out": ("TOML", "parameter file to write, for 'plumbob run --params'"),
                    "unproven": ("", "write the file even where no gain is shown"),
                },
                note="Exit code 3: no gain on held-out recordings is shown, or there is nothing to hold out; the "
                "parameter file is then not written, unless --unproven is given.",
                code=lambda tuning: 0 if tuning.proven else DIFFERENT,
            ),
        },
    ),
}  # fmt: skip
_HIDDEN: Final = ("excluded", "settings", "rate", "mount_angle", "mount_shift", "q_nb", "pos_n")
_VIRTUAL: Final = {"out": ("FILE", "write the virtual unit: .mcap, .parquet or .csv")}
_SUFFIXES: Final = {"out": (".mcap", ".parquet", ".csv")}


def _array(line: str, name: str, more: Mapping[str, tuple[str, str]] = _VIRTUAL, example: str = "") -> Verb:
    return Verb(
        line, "array.md", f"plumbob array {name} six.parquet{example}", f"arm.array.{name}", run="arm.array",
        writes={"out": ("written", save_virtual)},
        also=("read_array",), hidden=(*_HIDDEN, "format"), more=more, ends=_SUFFIXES,
    )  # fmt: skip


UNITS: Final = {
    "array": Verb(
        "several units on one body: how they differ, what they measure together, and which one is wrong",
        "array.md", "plumbob array monitor six.parquet",
        kinds={
            "info": _array("small rotations, relative biases and clock offsets, with their uncertainty", "info", {}),
            "combine": _array(
                "one virtual unit of all, by least squares", "combine",
                {**_VIRTUAL, "out": ("FILE!", _VIRTUAL["out"][1])}, " --out one.parquet",
            ),
            "monitor": _array("which unit contradicts the others, since when", "monitor", example=" --out one.parquet"),
        },
    ),
    "joints": Verb(
        "angles of a knee, a leg, an arm or a back from a unit on each segment, and the strides of a walk",
        "joints.md", "plumbob joints thigh.csv shank.csv --hinge knee --upright 0s..2s --out knee.csv",
        hidden=_HIDDEN, run="arm.joints", pages=arm_page,
        writes={"out": ("file", save), "stride": ("strides", _write_strides), "card": ("card", _write_card)},
        exclusive=(("hinge", "chain"),),
        more={
            "out": ("FILE", "table of angles: .csv, .parquet, or .mot for OpenSim"),
            "stride": ("FILE", "the mean stride from 0 to 100 %%: .csv or .parquet"),
            "card": ("JSON", "the chain as it was aligned, which --chain takes for another recording"),
        },
        note="Give a file for each unit, from the root on, or one recording of all. The axes of a segment come from "
        "when the body stood upright; without a stretch of that a hinge's angle counts from the first sample.",
    ),
    "arm": Verb(
        "joint angles of a chain, and programs taught with it",
        "arm.md", "plumbob arm export angles.parquet --chain arm.toml --out program.yaml",
        kinds={
            "align": Verb(
                "find how the units sit on their segments, and where joints lie",
                "arm.md", "plumbob arm align arm.toml calibration.mcap --pose 0s,2s --out card.json", "arm.align",
                also=("read_array",), hidden=(*_HIDDEN, "mounts"), repeat=("poses",), run="arm.align",
                writes={"out": ("card", save)}, more={"out": ("JSON!", "card to write")},
                note="A pose is FROM,TO and angles, all zero where none are named: 0s,2s or 5s,7s,0deg,90deg. A "
                "source is a recording of all units, or one file for each: FILE, whose stem is the unit's name, or "
                "UNIT=FILE.",
            ),
            "run": Verb(
                "estimate joint angles and the hand's place",
                "arm.md", "plumbob arm run card.json take.mcap --frame ENU --out angles.parquet", "arm.run",
                also=("read_array",), hidden=(*_HIDDEN, "mounts"), run="arm.run", pages=arm_page,
                writes={"out": ("file", save)}, more={"out": ("FILE", "table of angles: .csv or .parquet")},
            ),
            "export": Verb(
                "make a program of joint angles, and write it for a robot",
                "arm.md", "plumbob arm export angles.parquet --chain arm.toml --rate 125Hz --out program.yaml",
                "arm.taught", named=("limits",), run="arm.export", pages=lambda *_: None,
                more={
                    "limits": ("", "the chain, whose limits are kept"),
                    "out": ("FILE!+", "files to write, by suffix"),
                    "unit": ("rad|deg", "of a .csv file (default rad)"),
                    "as_is": ("", "write the angles as they are: no smoothing, no limits"),
                },
                note=".csv and .parquet are tables of times and angles; .yaml and .json are a ROS "
                "trajectory_msgs/JointTrajectory; .mcap is the same in CDR, with a sensor_msgs/JointState for each "
                "sample; .script is URScript of six joints. A .urdf is the chain itself, as a model for ROS.",
            ),
            "replay": Verb(
                "move a model by a program, and compare the hand with truth",
                "arm.md", "plumbob arm replay program.csv arm.urdf --truth hand.csv", "arm.replay", hidden=_HIDDEN,
                run="arm.replay", writes={"out": ("file", _write_hand)},
                more={
                    "truth": ("FILE", "table with the hand's place: hand_x [m] and so on"),
                    "out": ("FILE", "write the hand's place: .csv or .parquet"),
                },
            ),
        },
    ),
}  # fmt: skip
KNOWLEDGE: Final = {
    "demo": Verb(
        "an emulated buoy, calibrated, recorded, estimated and judged, in a minute",
        "start.md", "plumbob demo --out demo-out", "cli.demo.demo", run="demo", outputs=(),
        hidden=("folder", "duration", "say"),
        about="Emulate the drifting buoy of the paper: calibrate its unit by hand, record it in waves, estimate, "
        "replay with other filters, compare with the truth. Exit code 1 where the recording is not what was sent.",
        more={
            "out": ("FOLDER", "folder to write (demo-out)"),
            "duration": ("TIME", "of the buoy's sea (600s)"),
            "view": ("", "then show the emulated buoy on the live page: in a browser until Ctrl-C, or for 20 s where "
                     "there is none"),
        },
    ),
    "reproduce": Verb(
        "the systems of five papers whole, and their figures beside the papers'",
        "papers.md", "plumbob reproduce buoy", outputs=(),
    ),
    "list": Verb(
        "list filters, devices, rigs, scenarios, or the references of filters",
        "choose-a-filter.md", "plumbob list filters mekf",
        kinds={
            "filters": Verb(
                "filters with their parameters, units, defaults and ranges",
                "choose-a-filter.md", "plumbob list filters mekf", "reporting.catalogue.filters",
            ),
            "devices": Verb(
                "known devices: framing, fields with units and sources, options, registers; C header",
                "formats.md", "plumbob list devices mpu6000", "reporting.catalogue.devices", repeat=("options",),
                exclusive=(("markdown", "c", "json"),),
            ),
            "references": Verb(
                "references of filters, as lines or as BibTeX",
                "equations.md", "plumbob list references mahony --bib", "cite", run="text", json=False,
            ),
            "rigs": Verb(
                "rigs and faults of 'plumbob emulate'", "acquire.md", "plumbob list rigs", "reporting.catalogue.rigs",
            ),
            "scenarios": Verb(
                "scenarios, chains, programs and sensors of 'plumbob sim'",
                "start.md", "plumbob list scenarios", "reporting.catalogue.scenarios",
            ),
        },
    ),
    "docs": Verb(
        "print or open a page of the documentation", "start.md", "plumbob docs time", run="docs", json=False,
        more={"open": ("", "open the page in the browser; without PAGE the first one, start")},
    ),
}  # fmt: skip

GROUPS: Final = {
    "start here": START, "lines": LINES, "files": FILES, "simulate and judge": JUDGE, "several units": UNITS,
    "what there is": KNOWLEDGE,
}  # fmt: skip
VERBS: Final = {name: verb for verbs in GROUPS.values() for name, verb in verbs.items()}
VERB_BY_FUNCTION.update((verb.function or name, name) for name, verb in VERBS.items() if not verb.kinds)
