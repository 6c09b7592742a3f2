"""Hardware that is not there: `plumbob emulate`, and `plumbob.emulate`."""

import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Final

from plumbob import files
from plumbob.core.errors import LineError, ParameterError
from plumbob.core.files import profile_beside, replacing, require_place, write_text
from plumbob.core.signals import end_process, held_signals
from plumbob.core.units import Quantity, given, given_pace
from plumbob.data import TRIADS
from plumbob.data.cards import CalibrationCard
from plumbob.data.chain import chain_text
from plumbob.data.recording import Recording
from plumbob.files.arrow import TABLES, write_table
from plumbob.live.rigs.faults import Fault
from plumbob.live.rigs.rig import PLANS, Cards, Chained, Rig, RigPlan, make_rig, plan_for
from plumbob.live.rigs.serving import FilePort, Port, PtyPort, Served, TcpPort, UdpPort, serve
from plumbob.live.transports.transport import LOOPBACK, Stop, Stopping
from plumbob.protocols.format import Format
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.unpack import unit_prefixes
from plumbob.rotations import Frame
from plumbob.simulation import ChainSimulation, Scenario, draw_module
from plumbob.simulation import scenario as named_scenario
from plumbob.simulation.signals import Signal
from plumbob.simulation.simulation import WarmingUp

_END: Final = 0.5  # time that the process of a rig has to end, s


def emulate(
    what: str | Path, *, scenario: str | None = None, set: Mapping[str, Any] | None = None, sensors: str | None = None,
    reference: str | None = None, unit: str = "random", noise: Cards | None = None,
    temp_c: float | str | Signal | None = None, warm_up: WarmingUp | None = None, high_pass: float | str | None = None,
    mount_error: float | str = 0.0, frame: Frame | str | None = None, options: Mapping[str, str] | None = None,
    seed: int = 0, clock_error: float | str = 0.0, rate: float | str | None = None, duration: float | str | None = None,
    truth: str | Path | None = None, calibration: CalibrationCard | str | Path | None = None,
    flash_log: str | Path | None = None, link: str | Path | None = None, tcp: str | None = None, udp: str | None = None,
    write: str | Path | BinaryIO | None = None, speed: float | str | None = None,
    faults: Mapping[str, float | str] | None = None, fault_log: str | Path | None = None, overwrite: bool = False,
    stop: Stopping | None = None, opened: Callable[[str], object] | None = None,
    note: Callable[[str], object] | None = None,
) -> Served:  # fmt: skip
    """Send what a rig would send, from the moment that somebody listens, until it has said everything.

    Parameters
    ----------
    what : str or path
        A rig, or a format of your own.
    scenario : str, optional
        Motion of the body, or program of a chain; by default that of the rig.
    set : mapping, optional
        Parameters of `scenario`, or settings of a chain: SI, or text with a unit.
    sensors : str, optional
        Parts of the units that measure, joined by ``+``; by default a rig's own, and "ideal" of a format.
    reference : str, optional
        Parts of a rig's reference instead of its own; "ideal" says exactly what is true.
    unit : {"random", "calibrated"}
        As of `plumbob.simulate`; a reference keeps its errors, because they are its accuracy.
    noise : NoiseCard, str, path, or mapping, optional
        N, B and K of the units that measure, instead of their own: a card for all of them, or cards by the prefix of
        their fields.
    temp_c : float, str or Signal, optional
        Temperature, °C, constant or over time; by default 25 °C.
    warm_up : str or tuple, optional
        Rise and time constant of what is added to it, as ``"15 K, 120 s"``: ``rise (1 - exp(-t / time))``.
    high_pass : float or str, optional
        Corner, Hz, of a first-order high-pass behind each gyroscope that measures, before its converter.
    mount_error : float or str
        Standard deviation about each axis, rad, of how a rig's references really sit, drawn; of all units where none
        is a reference. Sessions and frames keep the mounting that is declared.
    frame : Frame or str, optional
        Navigation frame of a format's truth, and its body's axes; a rig has its own; by default NED.
    options : mapping of str to str, optional
        Options of the format.
    seed : int
        Of everything that is left to chance.
    clock_error : float or str
        Relative error of the device's clock; positive: fast.
    rate, duration : float or str, optional
        Frames per second, Hz, and how long, s; by default the format's and the scenario's.
    truth : path, optional
        Recording of samples and truth to write before the port is named; the unit's card is written beside it. Of a
        chain, true joint angles and the chain are written too.
    calibration : CalibrationCard or path, optional
        What a rig with a processor of its own, as ``buoy_attitude``, corrects its samples with.
    flash_log : path, optional
        Image of such a rig's Flash log as it is at the end; `plumbob.protocols.ring.read_ring` reads it.
    link, tcp, udp, write : optional
        Where to: a pseudo-terminal, to which `link` may lead; a server at ``HOST:PORT``; datagrams to ``HOST:PORT``; or
        the bytes alone into a file or an open stream.
    speed : float or "max", optional
        Times real time; by default 1, and as fast as possible with `write`.
    faults : mapping, optional
        Shares of the frames, by kind of fault.
    fault_log : path, optional
        Gets a line of JSON for each fault once it has happened.
    overwrite : bool
        Whether files that lie there may be replaced.
    stop : Stopping, optional
        Set from another thread to end.
    opened : callable, optional
        Called with the name of the port once it is open.
    note : callable, optional
        Called with what a reader of the port should know.

    Returns
    -------
    Served

    Raises
    ------
    ParameterError
        If something is not known, out of range, or does not go together.
    """
    pace = given_pace(speed or ("max" if write is not None else 1.0))
    form, plan = _plan(what, options, scenario, set, sensors, frame, given("rate", rate, Quantity.FREQUENCY))
    for path in outputs(what, truth, write, fault_log, flash_log):
        require_place(path, overwrite=overwrite)
    rig = make_rig(
        plan if reference is None else plan.with_reference(reference), form, seed=seed, unit=unit, noise=noise,
        duration=given("duration", duration, Quantity.TIME),
        clock_error=given("clock_error", clock_error, Quantity.RATIO) or 0.0,
        faults={kind: given(kind, share, Quantity.RATIO) or 0.0 for kind, share in (faults or {}).items()},
        calibration=None if calibration is None else CalibrationCard.of(calibration),
        high_pass=given("high_pass", high_pass, Quantity.FREQUENCY),
        mount_error=given("mount_error", mount_error, Quantity.ANGLE) or 0.0, temp_c=temp_c, warm_up=warm_up,
    )  # fmt: skip
    # before the port is named, so that who waits for it finds the truth and the card
    _write_beside(rig, truth, flash_log, noise=noise is not None, overwrite=overwrite)
    stop, say = stop or Stop(), note or (lambda text: None)
    if rig.firmware is not None:
        say("; ".join(f"{name} {fact}" for name, fact in rig.firmware.facts().items()))
    with _port(link, tcp, udp, write, stop, overwrite=overwrite) as port, _fault_log(fault_log) as log:
        if opened is not None:
            opened(port.name)
        if pace != 1.0 and not (write or udp):
            say('this line does not keep real time: record it with --time count, or time = "count" in [source]')
        return serve(rig, port, speed=None if pace == math.inf else pace, stop=stop, on_fault=log)


def noise_cards(words: Sequence[str]) -> Path | dict[str, Path] | None:
    """Noise cards that words name: one for all units, or by prefix; a path may hold an equals sign, too."""
    pairs = [word.partition("=") for word in words]
    named = {prefix: Path(card) for prefix, equals, card in pairs if equals and prefix.isidentifier()}
    if len(named) == len(words):
        return named or None
    if len(words) > 1:
        raise ParameterError("give --noise one card for all units, or UNIT=CARD once for each unit that has one.")
    return Path(words[0])


def outputs(
    what: str | Path, truth: str | Path | None, write: str | Path | BinaryIO | None, fault_log: str | Path | None,
    flash_log: str | Path | None = None,
) -> Iterator[Path]:  # fmt: skip
    """Files that `emulate` would write, with those beside them."""
    yield from (Path(path) for path in (write, fault_log, flash_log) if isinstance(path, str | Path))
    if truth is None:
        return
    form = find_format(what)
    if _is_rig(what, form) and isinstance(PLANS[form.name].scenario, Chained):
        yield from chain_files(Path(truth))
    for prefix in (
        [unit.prefix for unit in PLANS[form.name].units] if _is_rig(what, form) else unit_prefixes(form.messages[0])
    ):
        file = unit_file(Path(truth), prefix)
        yield from (
            file,
            *([profile_beside(file)] if file.suffix.lower() == ".csv" else []),
            file.with_suffix(".card.json"),
        )


def chain_files(path: Path) -> tuple[Path, Path, Path]:
    """Beside a recording of a chain's units: true angles, the chain as it is known, and with the true mounts."""
    table = path if path.suffix.lower() in TABLES else path.with_suffix(".parquet")
    return (
        table.with_stem(f"{path.stem}-angles"),
        path.with_suffix(".chain.toml"),
        path.with_name(f"{path.stem}-true.chain.toml"),
    )


def write_chain(path: Path, made: ChainSimulation, *, overwrite: bool = False) -> None:
    """Write what is true of a chain beside a recording of its units, in the files that `chain_files` names."""
    angles, nominal, true = chain_files(path)
    write_table(angles, made.columns(), overwrite=overwrite)
    for file, chain in ((nominal, made.chain), (true, made.true_chain)):
        write_text(file, chain_text(chain), overwrite=overwrite)


def _is_rig(what: str | Path, form: Format) -> bool:
    return form.name in PLANS and not str(what).endswith(".toml")


def _plan(
    what: str | Path, options: Mapping[str, str] | None, scenario: str | None, parameters: Mapping[str, Any] | None,
    sensors: str | None, frame: Frame | str | None, rate: float | None,
) -> tuple[Format, RigPlan]:  # fmt: skip
    form = find_format(what).bind(options or {})
    if _is_rig(what, form):
        plan = PLANS[form.name]
        if frame:
            raise ParameterError(f"rig {plan.name} has its own frame; leave --frame out.")
        if plan.firmware and rate:
            raise ParameterError(f"rig {plan.name} computes at its own rates; leave --rate out.")
        if sensors is not None:
            _require_triads(plan, form, sensors)
            plan = plan.with_sensors(sensors)
        return form, replace(_moved(plan, scenario, parameters), rate=rate or plan.rate)
    motion = _named(scenario, parameters)
    if motion is None:
        raise ParameterError(f"say what moves {form.name}: --scenario buoy, or another of 'plumbob list scenarios'.")
    return form, plan_for(form, motion, sensors=sensors or "ideal", frame=Frame.parse(frame or Frame.NED), rate=rate)


def _require_triads(plan: RigPlan, form: Format, sensors: str) -> None:
    """Refuse parts that leave a triad of a rig's frame without a sensor."""
    module = draw_module(sensors, 0)
    for prefix in (unit.prefix for unit in plan.measuring):
        for triad in TRIADS:
            name = f"{prefix}.{triad}" if prefix else triad
            if getattr(module, triad) is None and name in {field.triad for field in form.messages[0].fields}:
                raise ParameterError(
                    f"{module.name} has no {triad}, which the frame of {plan.name} has; add such a part."
                )


def _named(scenario: str | None, parameters: Mapping[str, Any] | None) -> Scenario | None:
    if parameters and scenario is None:
        raise ParameterError("--set gives parameters of a scenario; name it with --scenario.")
    return None if scenario is None else named_scenario(scenario, **(parameters or {}))


def _moved(plan: RigPlan, scenario: str | None, parameters: Mapping[str, Any] | None) -> RigPlan:
    """Plan with another motion: of a chain, another program and its settings; else another scenario."""
    if isinstance(plan.scenario, Chained):
        chained = plan.scenario
        settings = {**chained.settings, **(parameters or {})}
        return replace(plan, scenario=replace(chained, program=scenario or chained.program, settings=settings))
    motion = _named(scenario, parameters)
    return plan if motion is None else replace(plan, scenario=motion, duration=motion.duration)


@contextmanager
def _port(
    link: str | Path | None, tcp: str | None, udp: str | None, write: str | Path | BinaryIO | None, stop: Stopping, *,
    overwrite: bool,
) -> Iterator[Port]:  # fmt: skip
    with ExitStack() as stack:
        port: Port
        if isinstance(write, str | Path):
            temporary = stack.enter_context(replacing(Path(write), overwrite=overwrite))
            port = FilePort(stack.enter_context(temporary.open("wb")), str(write))
        elif write is not None:
            port = FilePort(write, "-")
        elif tcp:
            port = TcpPort(*_address(tcp))
        elif udp:
            port = UdpPort(*_address(udp))
        else:
            port = PtyPort(None if link is None else Path(link), stop)
        stack.callback(port.close)
        yield port


def _address(text: str) -> tuple[str, int]:
    host, colon, number = text.rpartition(":")
    if not colon or not number.isdecimal() or int(number) > 65535:
        raise ParameterError(f"an address must be HOST:PORT, as 127.0.0.1:4000, but got '{text}'.")
    return host or LOOPBACK, int(number)


@contextmanager
def _fault_log(path: str | Path | None) -> Iterator[Callable[[Fault], None]]:
    if path is None:
        yield lambda fault: None
        return
    with Path(path).open("w", encoding="utf-8") as file:
        yield lambda fault: print(json.dumps(fault.summary()), file=file, flush=True)


def unit_file(path: Path, prefix: str) -> Path:
    """Where the file of one of several units lies."""
    return path.with_stem(f"{path.stem}-{prefix}") if prefix else path


def _write_beside(
    rig: Rig, truth: str | Path | None, flash_log: str | Path | None, *, noise: bool, overwrite: bool
) -> None:
    """Write the image of its Flash log, and what is true of it."""
    if flash_log:
        if rig.firmware is None:
            raise ParameterError(
                f"rig {rig.plan.name} has no Flash log; emulate buoy_attitude, or leave --flash-log out."
            )
        with replacing(Path(flash_log), overwrite=overwrite) as temporary:
            temporary.write_bytes(rig.firmware.flash.image)
    if not truth:
        return
    path = Path(truth)
    for prefix, unit in rig.units.items():
        file = unit_file(path, prefix)
        notes = (unit.truth.source, *((f"noise {unit.noise.source}",) if noise else ()))
        recording = Recording(imu=unit.imu, track=unit.truth, name=file.stem, notes=notes)
        files.write(file, recording, overwrite=overwrite)
        unit.calibration.save(file.with_suffix(".card.json"), overwrite=overwrite)
    if rig.chain is not None:
        write_chain(path, rig.chain, overwrite=overwrite)


@contextmanager
def running_rig(rig: str, *words: str) -> Iterator[str]:
    """Emulate a rig in a process of its own, with more words of its command line; gives the name of its port."""
    command = [sys.executable, "-m", "plumbob", "emulate", rig, *words]
    with ExitStack() as stack:
        with held_signals():
            process = stack.enter_context(subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                start_new_session=True,
            ))  # fmt: skip
            stack.callback(end_process, process, 0.0, _END)
        assert process.stdout is not None and process.stderr is not None
        port = process.stdout.readline().strip()
        if not port:
            lines = process.stderr.read().strip().splitlines()
            raise LineError(f"the rig {rig} did not start: {lines[-1] if lines else 'it said nothing'}.")
        yield port
