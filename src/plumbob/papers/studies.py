"""What a study of a paper works with: its rig's bytes, seeds and errors; its rows, texts and drawings are data.

``<name>.toml`` beside the study says what each figure is, where it stands in the paper and which bar it has, and what
the page shows; the study measures. `Study.rows`, `Study.table` and `Study.draw` take what it measured, by key; it is
kept in a file, from which the page is made, also in another language, without another run.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob.core import __version__, check
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import write_text
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack
from plumbob.data.array import PRESETS
from plumbob.data.recording import Recording
from plumbob.evaluation.metrics import euler_errors
from plumbob.files import write
from plumbob.live.emulated import emulate, running_rig
from plumbob.live.record import record
from plumbob.live.replay import replay
from plumbob.live.rigs.rig import columns_for
from plumbob.live.runner import run_stream
from plumbob.live.session_toml import load_session
from plumbob.live.sinks import RecordingSink, TextSink
from plumbob.live.sources import open_source
from plumbob.live.stream import Stream
from plumbob.papers.description import PAPERS, Outcome, Paper, filled
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format
from plumbob.reporting.arm import stick_figure
from plumbob.reporting.catalogue import start
from plumbob.reporting.content import COLOURS, MUTED, Both, Scene, Table
from plumbob.reporting.report import Report
from plumbob.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

ANGLES: Final = ("yaw", "pitch", "roll")
MOUNTS: Final = PRESETS["arm"]
_COLUMNS: Final = 900  # points of a line that is drawn; of more, the least and the greatest of each column
_DASHES: Final = {"dashed": "--", "dotted": ":", "solid": "-", "none": ""}


class PlotCurve(NamedTuple):
    """A line of a drawing.

    `x`, `y` (N,): its points; `colour`: a name of `plumbob.reporting.content.COLOURS`; `dash`: "solid", "dashed",
    "dotted" or "none"; `mark`: a marker of matplotlib; `to` (N,) or (2, N): fill up to there, or bars from and to;
    `label`: beside the axes, at its first point.
    """

    x: Any
    y: Any
    colour: str = "blue"
    dash: str = "solid"
    width: float = 0.9
    mark: str = ""
    to: Any = None
    label: str = ""

    def thinned(self) -> "PlotCurve":
        """It with the points that are drawn: a long line by its envelope."""
        from plumbob.reporting.drawing import envelope

        x, y = np.asarray(self.x, float), np.asarray(self.y, float)
        if self.to is None and x.size > 2 * _COLUMNS and (np.diff(x) > 0.0).all():
            x, y = envelope(x, y, _COLUMNS, jump=180.0)
        return self._replace(x=x, y=y)

    def draw(self, ax: "Axes") -> None:
        """Draw it."""
        x, y, colour = np.asarray(self.x, float), np.asarray(self.y, float), COLOURS[self.colour]
        if np.ndim(self.to) == 1:
            ax.fill_between(x, y, self.to, color=colour, alpha=0.3, linewidth=0.0, step="post")
            return
        if self.label:
            ax.text(-0.01, y[0], self.label, transform=ax.get_yaxis_transform(), ha="right", va="center")
        if self.to is not None:
            ax.errorbar(x, y, np.abs(self.to - y), fmt="none", ecolor=colour, capsize=2, linewidth=0.8)
        how: dict[str, Any] = {"linestyle": _DASHES[self.dash], "linewidth": self.width, "marker": self.mark}
        ax.plot(x, y, color=colour, markersize=2.5, solid_capstyle="butt", **how)


def errors_deg(track: AttitudeTrack | Floats, truth: AttitudeTrack | Floats) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll, deg, of attitudes at the same times: tracks, or quaternions (N, 4)."""
    q, q_true = (of.q_nb if isinstance(of, AttitudeTrack) else of for of in (track, truth))
    return np.asarray(to_deg(euler_errors(q, q_true)))


def rms(values: Any, axis: int | None = None) -> Any:
    """Root mean square, along an axis or of all."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def largest(values: Any, axis: int | None = 0) -> Any:
    """Largest magnitude, along the first axis by default."""
    return np.max(np.abs(values), axis=axis)


def plain(value: Any) -> Any:
    """A value as JSON has it: arrays as lists, a text in two languages as a table of both."""
    if isinstance(value, Both):
        return {"en": value[:], "zh": value.zh}
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def record_line(file: Path) -> Stream:
    """Run the line of a session until its other end has said everything; all is kept as the session says."""
    session = load_session(file)
    assert session.record and session.output.text
    line, recording = Stream(session), RecordingSink(session, session.record)
    text = TextSink(session.output.text, session.output.every)
    run_stream(line, open_source(session.source), sinks=[text], recording=recording, until_lost=True)
    recording.recorder.close(_DISK)
    return line


_DISK: Final = 120.0  # longest wait for the disk of a busy machine at the end, s
_STEPS: Final = ("rows", "table", "draw", "scene")  # what a study is told, and its file holds
_FILE: Final = "study.json"
_SESSION = """\
kind = "plumbob session"
version = 1

[source]
kind = "file"
path = "{name}.bin"

[format]
name = "{rig}"
{more}"""


class Taken(NamedTuple):
    """Files of a rig that was emulated and recorded.

    `recording`: what its session recorded of its bytes, for `plumbob.read`, `plumbob.replay` and every verb; `truth`:
    what the simulator put into the frames, with the true attitude, for several units that of the first one, beside
    which those of the others are named after the units; `capture`, `session`: the bytes, and the session that says what
    they mean; `rig`, `how`: what was emulated.
    """

    recording: Path
    truth: Path
    capture: Path
    session: Path
    rig: str = ""
    how: Mapping[str, Any] = {}


class Study:
    """A paper's run: its folder, which exists, its seed, and what it has measured so far, by the keys of its file.

    `values`: what stands in the texts of the page, by name; `progress`: called with what is being done, how many steps
    are done, and of how many.
    """

    def __init__(
        self, name: str, folder: Path, seed: int = 1, progress: Callable[[str, int, int], None] | None = None
    ) -> None:
        self.folder, self.seed, self.progress = folder, seed, progress or (lambda what, done, of: None)
        self.name, self.description = name, PAPERS[name]
        self.values: dict[str, Any] = {"seed": seed}
        self.outcomes: dict[str, Outcome] = {}
        self.made, self.command = "", f"plumbob reproduce {name} --seed {seed}"  # when, and how long it took; by what
        self.figures: dict[str, Any] = {}
        self._calls: list[Any] = []
        self._content: dict[str, list[tuple[str, Any]]] = {"table": [], "figure": [], "scene": []}
        self._done = 0

    @classmethod
    def restored(cls, name: str, folder: Path, seed: int | None = None) -> "Study | None":
        """What `save` kept in a folder; None where it is not there, of another version, or of another seed."""
        try:
            text = (folder / _FILE).read_text(encoding="utf-8")
            saved = json.loads(text, object_hook=lambda of: Both(**of) if of.keys() == {"en", "zh"} else of)
        except (OSError, ValueError):
            return None
        if saved["version"] != __version__ or seed not in (None, saved["seed"]):
            return None
        study = cls(name, folder, saved["seed"])
        study.values, study.made = saved["values"], saved["made"]
        for step, args, more in saved["calls"]:
            getattr(study, check.one_of("a step", step, _STEPS))(*args, **more)
        return study

    def save(self, made: str) -> None:
        """Keep what was measured in the study's folder; `made`: when, and how long it took."""
        self.made = made
        content = {"version": __version__, "seed": self.seed, "made": made, "values": self.values, "calls": self._calls}
        write_text(self.folder / _FILE, json.dumps(plain(content), ensure_ascii=False) + "\n", overwrite=True)

    def live(self, taken: Taken, speed: float = 200.0) -> float:
        """Share of the attitudes of a live line that are those of the same bytes in a file, to the bit, %.

        The rig speaks again, so much faster than time, on a pseudo-terminal; what listens, and what reads the file, is
        the session of `plumbob start`, which has the paper's method. None counts where a replay is not the live line.
        """
        home, words = self.folder / "live", []
        for name, value in {"seed": self.seed, **taken.how}.items():
            pairs = [f"{of}={v}" for of, v in value.items()] if isinstance(value, Mapping) else [f"{value}"]
            words += [word for pair in pairs for word in (f"--{name.replace('_', '-')}", pair)]
        rows = []
        with running_rig(taken.rig, *words, "--speed", f"{speed:g}") as port:
            start(taken.rig, home, port=port, overwrite=True)
            started = (home / f"{taken.rig}.toml").read_text(encoding="utf-8")
            head, _, rest = started.partition("[source]\n")
            serial, _, rest = rest.partition("\n\n")
            for kind, source in (
                ("line", f'{serial}\nspeed = {speed:g}\ntime = "count"'),
                ("file", f'kind = "file"\npath = "../{taken.capture.name}"'),
            ):
                recording = home / f"{taken.rig}-{kind}.mcap"
                text = f"{head}[source]\n{source}\n\n{rest}"
                text = text.replace(f'"{taken.rig}-{{utc}}', f'"{recording.with_suffix("")}')
                for suffix in (".mcap", ".txt"):
                    recording.with_suffix(suffix).unlink(missing_ok=True)
                record_line(write_text(home / f"{kind}.session.toml", text, overwrite=True))
                again: Any = replay(recording, check=True)
                rows.append(again.track.q_nb if again.comparison.equal else again.track.q_nb[:0])
        line, file = rows
        return 100.0 * float(np.mean((line == file).all(axis=1))) if line.shape == file.shape and line.size else 0.0

    def step(self) -> None:
        """Say that the next of the steps begins that the file lists."""
        steps = self.description.content["paper"]["steps"]
        self.progress(steps[self._done], self._done, len(steps))
        self._done += 1

    def seeds(self, count: int) -> range:
        """Seeds of so many runs beside the one through bytes; those of another work are others."""
        return range(1000 * self.seed, 1000 * self.seed + count)

    def recorded(self, rig: str, name: str, *, session: str = "", text: Path | None = None, **how: Any) -> Taken:
        """Emulate a rig, whose name is that of its format, and record its bytes by a session, as a user would.

        `name`: of the files; `session`: what goes on in the session's table ``[format]``, and its further tables, as
        TOML; `text`: where the session's outward line goes; `how`: as of `plumbob.emulate`, with the seed of the work
        where none is given.
        """
        files = self._files(name)
        emulate(rig, **{"seed": self.seed, **how}, write=files.capture, truth=files.truth, overwrite=True)
        return self._record(rig, name, session, text)._replace(rig=rig, how=how)

    def sent(self, rig: str, name: str, said: Simulation, *, session: str = "", text: Path | None = None) -> Taken:
        """Send the samples of a simulation of your own in the frames of a rig of one unit, and record the bytes.

        Values are rounded and cut as the frame's fields do; otherwise as `recorded`.
        """
        files, form = self._files(name), find_format(rig).bind()
        t_ns = to_ns(said.imu.t)
        files.capture.write_bytes(
            encode(form, columns_for(form.messages[0], {"": said}, t_ns, np.arange(t_ns.size))).tobytes()
        )
        write(files.truth, Recording(imu=said.imu, track=said.truth, name=name), overwrite=True)
        return self._record(rig, name, session, text)

    def _files(self, name: str) -> Taken:
        ends = ".mcap", ".truth.parquet", ".bin", ".session.toml"
        recording, truth, capture, session = (self.folder / f"{name}{end}" for end in ends)
        return Taken(recording, truth, capture, session)

    def _record(self, rig: str, name: str, session: str, text: Path | None = None) -> Taken:
        """Record the bytes that lie in the folder by a session."""
        files = self._files(name)
        write_text(files.session, _SESSION.format(name=name, rig=rig, more=session), overwrite=True)
        files.recording.unlink(missing_ok=True)  # a recording is never written over
        notes: list[str] = []
        done = record(files.session, out=files.recording, text=text, note=notes.append)
        if done.lossy:  # a figure of what is left would be wrong without a word
            raise DecodeError(f"{files.recording} was not recorded completely: {'; '.join(notes)}.")
        return files

    def text(self, key: str, **values: Any) -> Both:
        """A text of the file."""
        return self.description.text(key, **values)

    def names(self, table: str, /, **values: Any) -> dict[str, str]:
        """Names of the rows of a table of the file."""
        return {key: filled(name, values) for key, name in self.description.content["table"][table]["names"].items()}

    def rows(self, figures: Mapping[str, Any], **more: Any) -> None:
        """Figures by key: by the paper's method, or a pair of that, which may be None, and ours; bars and texts."""
        self._calls.append(("rows", [figures], more))
        for key, value in figures.items():
            faithful, best = value if isinstance(value, list | tuple) else (value, None)
            numbers = {"faithful": None if faithful is None else float(faithful)}
            numbers["best"] = None if best is None else float(best)
            self.outcomes[key] = self.description.row(key, **{**self.values, **more}, **numbers)

    def table(self, key: str, rows: Mapping[str, Iterable[Any]] | Sequence[Iterable[Any]], **more: Any) -> None:
        """A table of the page: rows by the names that the file has for them, or with their names as first cells.

        Numbers are written by the file's ``form``, one or for each column; NaN is a dash.
        """
        self._calls.append(("table", [key, rows], more))
        spec, more = self.description.content["table"][key], {**self.values, **more}
        if isinstance(rows, Mapping):
            names = self.names(key, **more)
            rows = [[names[row], *cells] for row, cells in rows.items()]
        forms = spec.get("form", ".2f")

        def cell(value: Any, column: int) -> str:
            if isinstance(value, str):
                return value
            form = forms if isinstance(forms, str) else forms[(column - 1) % len(forms)]
            return f"{float(value) + 0.0:{form}}" if np.isfinite(value) else "-"

        cells = [[cell(value, column) for column, value in enumerate(row)] for row in rows]
        self._content["table"].append((spec["part"], self.description.table(key, cells, **more)))

    def draw(self, key: str, *panels: Sequence[Any], **more: Any) -> None:
        """A figure of the page: the curves of each of its axes, which the file describes."""
        curves = [[PlotCurve(*curve).thinned() for curve in panel] for panel in panels]
        self._calls.append(("draw", [key, *curves], more))
        spec = self.description.content["figure"][key]
        figure = self.description.figure(key, _drawing(spec, curves), **{**self.values, **more})
        self.figures[key] = figure = replace(figure, command=filled(spec.get("command", self.command), self.values))
        self._content["figure"].append((spec["part"], figure))

    def scene(self, part: str, scene: Scene | Mapping[str, Any]) -> None:
        """A body that moves, in a part of the page; a tenth of a millimetre is shown."""
        of: Any = dict(vars(scene)) if isinstance(scene, Scene) else dict(scene)
        of["t"], sets = np.round(of["t"], 4), ("points", "values", "shadow")
        of |= {name: {key: np.round(value, 4) for key, value in dict(of[name]).items()} for name in sets}
        pairs = {name: list(of[name].items()) for name in sets}  # whose names have their Chinese, as no key of JSON has
        self._calls.append(("scene", [part, {**of, **pairs}], {}))
        self._content["scene"].append((part, Scene(**of)))

    def paper(self) -> Paper:
        """The page, and every figure in the order of the file."""
        content = self.description.content
        if missing := [key for key in content["outcome"] if key not in self.outcomes]:
            raise ParameterError(f"{self.name} has not measured {', '.join(missing)}.")
        parts = [self._part(key) for key in content["part"] if key != "page"]
        return Paper(self._part("page", parts=parts), [self.outcomes[key] for key in content["outcome"]])

    def _part(self, key: str, **more: Any) -> Report:
        fixed: list[tuple[str, Table]] = [
            (spec["part"], self.description.table(name, of=self.outcomes, **self.values))
            for name, spec in self.description.content["table"].items()
            if "rows" in spec
        ]
        by_kind = {
            "tables": [*self._content["table"], *fixed],
            "figures": self._content["figure"],
            "scenes": self._content["scene"],
        }
        chosen = {kind: [one for part, one in each if part == key] for kind, each in by_kind.items()}
        return self.description.part(key, of=self.outcomes, **chosen, **more, **self.values)


def _drawing(spec: Mapping[str, Any], panels: Sequence[Sequence[PlotCurve]]) -> "Callable[[FigureBase], None]":
    """Draw curves on a grid of axes: ``grid`` rows and columns, by default below each other; ``axes`` see `filled`.

    Of each axes: what `set` of matplotlib takes, and ``h`` and ``v``, places of lines across and up.
    """

    def draw(canvas: "FigureBase") -> None:
        rows, columns = spec.get("grid", (len(panels), 1))
        grid = canvas.subplots(rows, columns, sharex=spec.get("sharex", False), sharey=spec.get("sharey", False))
        axes: Iterable[tuple[Any, ...]] = zip_longest(np.ravel(grid), panels, spec.get("axes", ()), fillvalue={})
        for ax, curves, settings in axes:
            for curve in curves:
                curve.draw(ax)
            for at in settings.get("h", ()):
                ax.axhline(at, color=MUTED, linewidth=0.7, linestyle="--")
            for at in settings.get("v", ()):
                ax.axvline(at, color=MUTED, linewidth=0.6, linestyle=":")
            for name, axis in (("xscale", ax.xaxis), ("yscale", ax.yaxis)):
                if name in settings:
                    ax.set(**{name: settings[name]})
                    axis.set_major_formatter(lambda value, _: f"{value:g}")
                    axis.set_minor_formatter(lambda value, _: "")

    return draw


__all__ = ["ANGLES", "MOUNTS", "PlotCurve", "Scene", "Study", "Taken", "errors_deg", "largest", "rms", "stick_figure"]
