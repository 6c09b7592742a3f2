"""The live view: a line, a recording or an emulated rig, shown by a server of its own, and what pages may ask of it."""

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from plumbob.core import check
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.event import Event
from plumbob.core.files import text_of
from plumbob.core.text import FactsText, counted
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack
from plumbob.data.cards import CalibrationCard
from plumbob.data.chain import Chain, chain_text
from plumbob.door.reading import read
from plumbob.live.record import announce
from plumbob.live.runner import Note, Ran, Watch, run_stream, silence_words
from plumbob.live.sending import send_sinks, with_sent
from plumbob.live.session import ChainSpec, Session
from plumbob.live.session_toml import ALL, SESSION, capture_session, parse_session
from plumbob.live.sinks import RecordingSink, Sink, named_at, text_sinks
from plumbob.live.sources import open_sources
from plumbob.live.stream import Stream
from plumbob.live.transports.outgoing import require_writable
from plumbob.live.transports.transport import Stop, Stopping
from plumbob.viewer.child import ServerOutlet, Serving, require_view
from plumbob.viewer.commands import CommandHandler, Outlet
from plumbob.viewer.feed import Feed
from plumbob.viewer.messages import Command
from plumbob.viewer.playback import Player, load
from plumbob.viewer.switch import Switch

HTTP_PORT: Final = 8770  # Where the view is served, unless another port is asked for
_PAUSE: Final = 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Viewed(FactsText):
    """A view that has ended."""

    name: str
    ran: Ran | None  # of a line: what it gave
    recordings: Sequence[Mapping[str, Any]] = ()  # facts of each that was made
    restarts: int = 0  # how often the server had to be started again
    fault: str = ""  # why the view ended before the line

    @property
    def lossy(self) -> bool:
        """Whether rows of a recording are lost, or an output beside it failed."""
        return any(file["acknowledged"] < file["rows"] or file.get("failed") for file in self.recordings)

    @property
    def nothing(self) -> str | None:
        """Why a line gave no sample, and where to look; None where there are some."""
        return None if self.ran is None or self.ran.samples else silence_words(self.ran.stream)

    def facts(self) -> Mapping[str, str]:
        """What was shown, and what was recorded."""
        shown = {"shown": self.name} if self.ran is None else dict(self.ran.facts())
        return shown | {"recorded": ", ".join(str(recording["path"]) for recording in self.recordings) or "nothing"}

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        shown = {"shown": self.name} if self.ran is None else self.ran.summary()
        return shown | {"recordings": [dict(recording) for recording in self.recordings], "restarts": self.restarts}

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        lines = [f"shown        {self.name}" if self.ran is None else self.ran.text()]
        for file in self.recordings:
            lines.append(f"recorded     {file['path']}: {file['acknowledged']} of {file['rows']} rows on disk")
        if self.ran is not None and not self.recordings:
            lines.append("recorded     nothing")
        if self.restarts:
            lines.append(f"server       started again {counted(self.restarts, 'time')}")
        return "\n".join([*lines, *([f"view         {self.fault}"] if self.fault else [])])


def has_display() -> bool:
    """Whether there is a screen that a browser could open on."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def view(
    what: "Session | str | Path | None" = None, *, host: str = "127.0.0.1", http_port: int = HTTP_PORT,
    control: bool = False, clients: int | None = None, allow_origin: Sequence[str] = (), folder: str | Path = ".",
    also: Sequence[str] = (), chain: Chain | str | Path | None = None, emulate: str | None = None,
    terminal: bool = False, lang: str = "en", open_browser: bool = False, duration: float | str | None = None,
    send: Sequence[str] = (), stop: Stopping | None = None, note: Note | None = None,
    opened: Callable[[str], object] | None = None, **line: Any,
) -> Viewed:  # fmt: skip
    """Show a line as it runs, or play a recording, on a page that this machine serves.

    Parameters
    ----------
    what : Session or path, optional
        A session file (``.toml``), a recording, or a serial port, whose ``format`` is then to be given.
    host : str
        Address to listen at; another one than this machine's own is asked for, and reached with the token alone.
    http_port : int
        Port; 0 takes a free one.
    control : bool
        Whether the page, and `plumbob.control`, may ask for something: to record, to mark, to seek.
    clients : int, optional
        Pages at most.
    allow_origin : sequence of str
        Origins of other pages that may connect, as of Foxglove.
    folder : path
        Where recordings and texts go that the page asks for.
    also : sequence of str
        Further estimators beside the session's.
    chain : Chain or path, optional
        Chain whose segments carry the units; its stick figure is shown.
    emulate : str, optional
        A rig of `plumbob emulate`, which is started and shown.
    terminal : bool
        Show it as text that fills a terminal, as over ssh, and serve no page. Keys: q ends, r starts and stops a
        recording, m marks, the space bar pauses what is played, and t lets angles count from the attitude now.
    lang : {"en", "zh"}
        Language of the labels in a terminal.
    open_browser : bool
        Whether to open the page.
    duration : float or str, optional
        When to stop: s, or text with a unit; by default when somebody says `stop`.
    send : sequence of str
        To whom the attitude of a line is sent, as of `plumbob.record`.
    stop : Stopping, optional
        Set from another thread to end.
    note : callable, optional
        Called with each remark as it is made.
    opened : callable, optional
        Called with the address of the page, with its token, before the first sample; empty in a terminal.
    **line
        Of a line: as of `plumbob.record`; of a recording: ``filter``, ``causal``, ``lag``, ``params``, ``frame``,
        ``init``, ``calibration``, ``noise``, ``place``, ``date``, ``profile``, ``unit`` as of `plumbob.estimate`.

    Returns
    -------
    Viewed

    Raises
    ------
    ParameterError
        If not exactly one thing to show is named, or options do not fit it.
    MissingExtraError
        If what a server needs is not installed.
    LineError
        If the line or the port cannot be opened.
    PlumbobError
        As `plumbob.load_session`, `plumbob.estimate`.
    """
    place = check.path("folder", folder)
    if place != Path():  # where somebody named it, recordings are meant
        require_writable(place / "recording", overwrite=True)
    seconds = given("duration", duration, Quantity.TIME, positive=True)
    if terminal:
        return _fill_terminal(what, lang=lang, folder=place, duration=seconds, stop=stop, also=also, chain=chain,
                              emulate=emulate, opened=opened, line=line)  # fmt: skip
    require_view()
    say = note or (lambda line: None)
    serving = Serving(host=host, port=http_port, control=control, clients=clients, allow_origin=tuple(allow_origin),
                      folder=place)  # fmt: skip
    with ExitStack() as stack:
        shown = stack.enter_context(opened_up(what, emulate=emulate, chain=chain, note=say, line=line, also=also))
        shown.sends(send)
        server = ServerOutlet(serving, say)
        stack.callback(server.close)
        server.card = shown.card_in(Path(stack.enter_context(TemporaryDirectory(prefix="plumbob-view-"))))
        server.start()

        def begun() -> None:
            if opened is not None:
                opened(server.url)
            if open_browser:
                import webbrowser

                webbrowser.open(server.url)

        viewed = shown.run(
            server, folder=place, control=control, duration=seconds, stop=stop, note=say, echo=say, opened=begun
        )
        return replace(viewed, restarts=server.starts - 1)


def _fill_terminal(
    what: "Session | str | Path | None", *, lang: str, folder: Path, duration: float | None, stop: Stopping | None,
    also: Sequence[str], chain: Chain | str | Path | None, emulate: str | None,
    opened: Callable[[str], object] | None, line: Mapping[str, Any],
) -> Viewed:  # fmt: skip
    """Show it as text that fills a terminal, which standard output must be; arguments as of `view`."""
    from plumbob.viewer.terminal import Terminal, keys_at_once, painted

    if not sys.stdout.isatty():
        raise ParameterError(
            "--terminal fills a terminal, and standard output is not one. 'plumbob record' follows a line without one."
        )
    ended = Stop(stop)
    terminal = Terminal(ended, lang)

    def note(text: str) -> None:
        terminal.event(terminal.now.t, "note", text)

    with ExitStack() as stack:
        shown = stack.enter_context(opened_up(what, emulate=emulate, chain=chain, note=note, line=line, also=also))
        stack.enter_context(keys_at_once())
        stack.enter_context(painted(terminal))
        return shown.run(
            terminal, folder=folder, control=True, duration=duration,
            stop=ended, note=note, echo=lambda text: None, opened=lambda: opened and opened(""),
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class _Presentation:
    """How something is shown, whatever it is."""

    # folder, control, duration, stop, note: as of `view`
    folder: Path
    control: bool
    duration: float | None
    stop: Stopping | None
    note: Note
    echo: Note  # called with what the outlet shows as events
    opened: Callable[[], None]  # called before the first sample


class Shows:
    """Something that can be shown: a line or a recording, with `options` by which it is estimated."""

    def __init__(
        self, session: Session | None = None, path: Path | None = None, *, options: Mapping[str, Any] | None = None,
        also: Sequence[str] = (), chain: Chain | str | Path | None = None, truth: AttitudeTrack | None = None,
    ) -> None:  # fmt: skip
        self._session, self._path, self._options = session, path, dict(options or {})
        self._also, self._chain, self._truth = also, chain, truth

    def sends(self, send: Sequence[str]) -> None:
        """Send the attitude there as well."""
        if send and self._session is None:
            raise ParameterError("--send of view belongs to a line; a recording is sent by 'plumbob send'.")
        if self._session is not None:
            self._session = with_sent(self._session, send)

    def card_in(self, folder: Path) -> Path | None:
        """Copy of the session's card in a folder; None where there is none."""
        if self._session is None or self._session.card is None:
            return None
        path = folder / "card.json"
        self._session.card.save(path)
        return path

    def run(self, outlet: Outlet, **how: Any) -> Viewed:
        """Show it in an outlet until its end, or until it is stopped; `how` is that of `_Presentation`."""
        if self._session is not None:
            return self._follow(self._session, outlet, _Presentation(**how))
        assert self._path is not None
        return self._play(self._path, outlet, _Presentation(**how))

    def _follow(self, session: Session, outlet: Outlet, how: "_Presentation") -> Viewed:
        session = named_at(session, time.time_ns())
        stream = Stream(session, covariance=True)
        announce(session, how.note)
        switch = Switch(stream, how.folder, None if session.record is None else RecordingSink(session, session.record))
        feed = Feed(
            stream, outlet, also=self._also, truth=self._truth, control=how.control, recording=True,
            beside=lambda: {"recording": switch.recording, "text": switch.text}, note=how.note,
        )  # fmt: skip

        def remark(line: str) -> None:
            how.echo(line)
            feed.say(feed.now, "remark", line)

        watch = Watch(stream, remark, events=False)
        desk = CommandHandler(outlet, "for a recording that is played, and this is a line", {
            "record": lambda command: switch.record(command.name),
            "stop": lambda command: switch.stop(),
            "mark": lambda command: switch.mark(command.text),
            "text": lambda command: switch.write_text(command.name),
            "text-stop": lambda command: switch.stop_text(),
            "add": lambda command: feed.add(command.name),
            "remove": lambda command: feed.remove(command.name),
        })  # fmt: skip
        texts = text_sinks(session)
        source = open_sources(session)
        sending = send_sinks(session, note=remark)
        how.opened()

        def each() -> None:
            watch.look()
            desk.serve()
            feed.tick()

        sinks: list[Sink] = [watch, _RemarkSink(how.echo), feed, *texts, *sending]
        run_stream(stream, source, sinks=sinks, recording=switch, duration=how.duration, stop=how.stop, each=each)
        return Viewed(session.name, Ran(watch), switch.recordings, fault=feed.failed)

    def _play(self, path: Path, outlet: Outlet, how: "_Presentation") -> Viewed:
        loaded = load(path, also=self._also, chain=self._chain, note=how.note, **self._options)
        player = Player(loaded, outlet, control=how.control)
        desk = CommandHandler(outlet, "for a line, and this is a recording that is played", {
            "play": lambda command: player.play(),
            "pause": lambda command: player.pause(),
            "seek": lambda command: player.seek(_number(command)),
            "speed": lambda command: player.set_speed(_number(command)),
            "add": lambda command: player.add(command.name),
            "remove": lambda command: player.remove(command.name),
        })  # fmt: skip
        how.opened()
        end = None if how.duration is None else time.monotonic() + how.duration
        while not (how.stop and how.stop.is_set()) and (end is None or time.monotonic() < end):
            desk.serve()
            player.tick()
            time.sleep(_PAUSE)
        return Viewed(path.name, None)


def _number(command: Command) -> float:
    if command.value is None:
        raise ParameterError(f"'{command.verb}' needs a number.")
    return command.value


@contextmanager
def opened_up(
    what: "Session | str | Path | None", *, emulate: str | None, chain: Chain | str | Path | None, also: Sequence[str],
    note: Note, line: Mapping[str, Any],
) -> Iterator[Shows]:  # fmt: skip
    """What is to be shown, and a rig that runs meanwhile, where one is emulated."""
    if emulate is not None:
        if what is not None or line.get("port"):
            raise ParameterError("an emulated rig is the line; leave the session, the recording or the port out.")
        with emulated(emulate, note, line) as (session, truth, its_chain):
            yield Shows(_with_chain(session, chain or its_chain, "" if chain else "zero"), also=also, truth=truth)
        return
    if isinstance(what, Session):
        if any(value is not None for value in line.values()):
            raise ParameterError("a Session says everything about its stream; leave the other options out.")
        yield Shows(_with_chain(what, chain), also=also)
        return
    from plumbob.files import is_recording

    path = None if what is None else check.path("what", what)
    if path is not None and is_recording(path):
        yield Shows(path=path, options=_of_recording(line), also=also, chain=chain)
        return
    words = _of_line(path, line)
    if chain is not None and "file" not in words:
        words = {"unit": ALL, **words}
    yield Shows(_with_chain(capture_session(**words), chain), also=also)


def _with_chain(session: Session, chain: Chain | str | Path | None, pose: str = "") -> Session:
    """Session whose units a chain carries, which a recording of it then holds."""
    if chain is None:
        return session
    if session.chain is not None:
        raise ParameterError("the session has a [chain] already; leave --chain out.")
    if isinstance(chain, Chain):
        name, text = "chain.toml", chain_text(chain)
    else:
        name, text = str(chain), text_of(check.path("chain", chain))
    table = f"\n[chain]\nfile = {json.dumps(name)}\n" + f'pose = "{pose}"\n' * bool(pose)
    texts = {**session.texts, name: text, SESSION: session.texts[SESSION] + table}
    session = replace(session, chain=ChainSpec(name, text, pose or None), texts=texts)
    assert session.made_chain is not None  # refuses what does not fit
    return session


def _of_line(path: Path | None, line: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a line, which a session file or a port names."""
    words = {name: value for name, value in line.items() if value is not None}
    if words.pop("causal", None):
        raise ParameterError("--causal is for a recording, and this is a line. Leave it out.")
    if path is None:
        return words
    if path.suffix.lower() == ".toml":
        return {"file": path, **words}
    if "port" in words:
        raise ParameterError(f"{path} and --port both name the line; give one of them.")
    if not {"format", "profile"} & set(words) and not path.exists():
        raise ParameterError(f"{path} does not exist. Name a recording, a session file, or a serial port.")
    if path.is_file():
        raise ParameterError(
            f"{path} is neither a session (.toml), nor a recording by its suffix '{path.suffix}', nor a port, but a "
            "file. Raw bytes become a recording with 'plumbob record --from'."
        )
    return {"port": str(path), **words}


_BAUD: Final = 115200
_ESTIMATE: Final = (
    "filter", "causal", "lag", "params", "frame", "init", "calibration", "noise", "place", "date", "profile", "unit",
)  # fmt: skip


def _of_recording(line: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a recording."""
    words = {name: value for name, value in line.items() if value is not None and (name, value) != ("baud", _BAUD)}
    unknown = sorted(words.keys() - set(_ESTIMATE))
    if unknown:
        raise ParameterError(f"{unknown[0]} belongs to a line, and this is a recording. Leave it out.")
    return {name: value for name, value in words.items() if value not in (False, {})}


class _RemarkSink(Sink):
    """Sink that says what happened, as remarks."""

    def __init__(self, note: Note) -> None:
        self._note = note

    def on_event(self, event: Event) -> None:
        """Say it."""
        self._note(f"{event.kind}: {event.text}")


_FILTER: Final = "mekf"
_BLIND: Final = "integrate"  # What estimates a rig that has a gyroscope alone


@contextmanager
def emulated(
    rig: str, note: Note, line: Mapping[str, Any]
) -> Iterator[tuple[Session, AttitudeTrack | None, Path | None]]:
    """Session of a rig that runs meanwhile, the truth of its first unit, and its chain, where it is on one."""
    from plumbob.live.emulated import chain_files, running_rig, unit_file
    from plumbob.live.rigs.rig import PLANS, Chained

    if rig not in PLANS:
        raise unknown_name("rig", rig, PLANS)
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
                session = _calibrated(session, {unit.prefix: unit_file(truth, unit.prefix) for unit in plan.units})
            its_chain = chain_files(truth)[1] if isinstance(plan.scenario, Chained) else None
            yield replace(session, name=rig), recording.track, its_chain


def _calibrated(session: Session, units: Mapping[str, Path]) -> Session:
    """Session whose units have their cards, which a recording of it then holds."""
    tables, cards = [session.texts[SESSION]], dict[str, str]()
    for unit, file in units.items():
        path = file.with_suffix(".card.json")
        name = f"{unit}.card.json"
        cards[name] = text_of(path)
        device = CalibrationCard.load(path).device
        tables.append(
            f"[[unit]]\nname = {json.dumps(unit)}\ndevice = {json.dumps(device)}\ncard = {json.dumps(name)}\n"
        )
    return parse_session("\n".join(tables), {**session.texts, **cards}.__getitem__, name=session.name)
