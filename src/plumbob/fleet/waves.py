"""Sea states by burst, of recordings of whatever floats: `plumbob.waves`, its tables and its NetCDF file."""

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import __version__, check
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.findings import Finding, warning
from plumbob.core.result import plain
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given, to_deg
from plumbob.data import ImuData
from plumbob.data.recording import Recording
from plumbob.door.estimate import given_noise
from plumbob.files.arrow import TABLES, write_table
from plumbob.fleet.batch import batch, listed_items
from plumbob.fleet.items import JOBS, Source
from plumbob.fleet.urls import is_url
from plumbob.fleet.wave_reference import nearest, read_reference
from plumbob.overview.report_entry import read_subject
from plumbob.quality.quality import MEANING
from plumbob.quality.spectra import FEWEST as SEGMENTS
from plumbob.quality.waves import CONFIDENCE, LONGEST_WAVES, PERIODS, SHORTEST_WAVES, WaveSettings
from plumbob.reporting.overview import make_gatherer

_SHOWN: Final = 24  # bursts whose numbers the text has
# Numbers of a burst by their name in JSON: unit, standard name of CF or none, and what they are.
_BULK: Final[Mapping[str, tuple[str, str, str]]] = {
    "hm0_m": ("m", "sea_surface_wave_significant_height", "significant wave height Hm0"),
    "hm0_low_m": ("m", "", f"lower end of the band of {CONFIDENCE:.0%} of Hm0"),
    "hm0_high_m": ("m", "", f"upper end of the band of {CONFIDENCE:.0%} of Hm0"),
    "tp_s": ("s", "sea_surface_wave_period_at_variance_spectral_density_maximum", "peak period Tp"),
    "tm01_s": ("s", "sea_surface_wave_mean_period_from_variance_spectral_density_first_frequency_moment",
               "mean period Tm01"),
    "tm02_s": ("s", "sea_surface_wave_mean_period_from_variance_spectral_density_second_frequency_moment",
               "mean period Tm02"),
    "tm_10_s": ("s", "sea_surface_wave_mean_period_from_variance_spectral_density_inverse_frequency_moment",
                "mean period Tm-10"),
    "direction_deg": ("degree", "sea_surface_wave_from_direction", "mean direction that waves come from"),
    "direction_sd_deg": ("degree", "", "standard deviation of the mean direction"),
    "spread_deg": ("degree", "sea_surface_wave_directional_spread", "directional spread of all waves"),
    "spread_sd_deg": ("degree", "", "standard deviation of the directional spread"),
    "peak_direction_deg": ("degree", "sea_surface_wave_from_direction_at_variance_spectral_density_maximum",
                           "direction that waves of the peak come from"),
    "peak_spread_deg": ("degree", "sea_surface_wave_directional_spread_at_variance_spectral_density_maximum",
                        "directional spread at the peak"),
    "hidden_m": ("m", "", "significant height of longer waves that the noise may hide"),
    "low_hz": ("Hz", "", "lowest frequency of waves that count"),
    "high_hz": ("Hz", "", "highest frequency of waves that count"),
    "degrees_of_freedom": ("1", "", "degrees of freedom of each spectral density"),
}  # fmt: skip
_SPECTRAL: Final[Mapping[str, tuple[str, str, str]]] = {
    "density_m2_per_hz": ("m2 s", "sea_surface_wave_variance_spectral_density", "variance spectral density E(f)"),
    "a1": ("1", "", "first northward Fourier coefficient of the direction that waves come from"),
    "b1": ("1", "", "first eastward Fourier coefficient of the direction that waves come from"),
    "a2": ("1", "", "second Fourier coefficient, of the cosine of twice that direction"),
    "b2": ("1", "", "second Fourier coefficient, of the sine of twice that direction"),
    "check": ("1", "", "check factor: horizontal over vertical motion, 1 in deep water"),
}
_ROW: Final = (
    "{hm0_m:8.2f} {hm0_low_m:6.2f}–{hm0_high_m:<6.2f} {tp_s:7.2f} {tm02_s:6.2f} {direction_deg:5.0f}° "
    "{direction_sd_deg:3.0f}° {spread_deg:6.0f}° {spread_sd_deg:3.0f}°"
)
_FILE_NAMES: Final = {"density_m2_per_hz": "efth"}  # as wavespectra names them


@dataclass(frozen=True, eq=False, repr=False)
class Waves(Series):
    """Sea states, a burst each, in the order of the recordings and of time.

    `bursts` are their numbers as JSON has them: `recording`, `begin_s`, `end_s`, `begin_utc` (None where the recording
    does not know it), `flag` (QARTOD's, the worst of all tests), `tests`, and those of `quality.waves.SeaState`.
    `place` is (latitude, longitude), degrees, or None. `reference` has numbers (B,) of another buoy by the same names,
    those nearest in time.
    """

    bursts: tuple[Mapping[str, Any], ...]
    notes: tuple[Finding, ...] = ()
    place: tuple[float, float] | None = None
    reference: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def frequency(self) -> Floats:
        """Frequencies (F,) of all spectra, those of the first burst up to the highest wave, Hz."""
        first = self.bursts[0]["spectrum"]["frequency_hz"]
        top = max(burst["high_hz"] for burst in self.bursts)
        return np.array([f for f in first if f <= top])

    def spectrum(self, name: str = "density_m2_per_hz") -> Floats:
        """Spectra (B, F) at `frequency`: E, m²/Hz, or "a1", "b1", "a2", "b2", "check"; of another grid by lines."""
        f, rows = self.frequency, []
        for burst in self.bursts:
            spectrum = burst["spectrum"]
            x, y = (np.array(spectrum[key], dtype=float) for key in ("frequency_hz", name))
            same = x.size >= f.size and np.allclose(x[: f.size], f, rtol=1e-3)
            rows.append(y[: f.size] if same else np.interp(f, x, y, left=math.nan, right=math.nan))
        return np.array(rows)

    @property
    def time(self) -> Floats:
        """Middle of each burst (B,), s: since 1970 UTC where all know it, else of its recording."""
        return np.asarray(np.array(self._begins()) + 0.5 * self._durations(), dtype=np.float64)

    @property
    def is_utc(self) -> bool:
        """Whether `time` is UTC."""
        return all(burst["begin_utc"] for burst in self.bursts)

    def _begins(self) -> list[float]:
        if not self.is_utc:
            return [burst["begin_s"] for burst in self.bursts]
        return [float(np.datetime64(burst["begin_utc"].rstrip("Z"), "s").astype(float)) for burst in self.bursts]

    def _durations(self) -> Floats:
        return np.array([burst["end_s"] - burst["begin_s"] for burst in self.bursts])

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time and the numbers of each burst."""
        names = {f"{_stem(name)} [{unit.replace('degree', 'deg')}]": name for name, (unit, _, _) in _BULK.items()}
        numbers = {title: self._numbers(name) for title, name in names.items()}
        flag = np.array([burst["flag"] for burst in self.bursts], dtype=np.int64)
        beside = {f"reference {title}": self.reference[name] for title, name in names.items() if name in self.reference}
        return {"time_utc [s]" if self.is_utc else "time [s]": self.time} | numbers | {"flag": flag} | beside

    def _numbers(self, name: str) -> Floats:
        return np.array([math.nan if burst[name] is None else burst[name] for burst in self.bursts])

    def facts(self) -> Mapping[str, str]:
        """How many bursts, and the highest waves."""
        heights = self._numbers("hm0_m")
        highest = "-" if np.isnan(heights).all() else f"{np.nanmax(heights):.2f} m"
        return {"bursts": str(len(self.bursts)), "highest Hm0": highest}

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        notes = [note.to_dict() for note in self.notes]
        numbers = {"bursts": list(self.bursts), "place": self.place, "reference": dict(self.reference), "notes": notes}
        return dict(plain(numbers))

    def differences(self) -> Mapping[str, Floats]:
        """Numbers (B,) less those of the reference, by their names; of directions the shorter way round."""
        apart = {name: self._numbers(name) - values for name, values in self.reference.items()}
        return {
            name: (each + 180.0) % 360.0 - 180.0 if name.endswith("direction_deg") else each
            for name, each in apart.items()
        }

    def compare(self, reference: str | Path) -> "Waves":
        """The same beside the table of another buoy, as `waves` takes it; ParameterError where no time is near."""
        if not self.is_utc:
            raise ParameterError(
                "a reference is found by UTC, which these recordings do not know. Use a file whose times are UTC."
            )
        names = {standard: name for name, (_, standard, _) in _BULK.items() if standard}
        times, numbers = read_reference(reference, names)
        beside = nearest(times, numbers, self.time, self._durations()) if times.size else {}
        if not any(np.isfinite(values).any() for values in beside.values()):
            span = (
                " to ".join(str(np.datetime64(int(t), "s")) for t in (times.min(), times.max())) if times.size else "-"
            )
            raise ParameterError(f"{reference} has no waves within a burst of these: its times are {span} UTC.")
        return replace(self, reference=beside)

    def text(self) -> str:
        """A line for each burst, with what did not pass."""
        lines = [f"{'begin':20} {'Hm0 [m]':>8} {'95 % band':>13} {'Tp [s]':>7} {'Tm02':>6} {'from':>6} {'±':>4} "
                 f"{'spread':>7} {'±':>4}  flag"]  # fmt: skip
        for burst in self.bursts[:_SHOWN]:
            begin = burst["begin_utc"] or f"{burst['begin_s']:g} s"
            numbers = {name: math.nan if burst[name] is None else burst[name] for name in _BULK}
            why = ", ".join(name for name, flag in burst["tests"].items() if flag not in (1, 2))
            cells = _ROW.format(**numbers).replace("nan", "  -")
            lines.append(f"{begin:20} {cells}  {MEANING[burst['flag']]}{f' ({why})' if why else ''}")
        if (more := len(self.bursts) - _SHOWN) > 0:
            lines.append(f"and {counted(more, 'further burst')}; --out writes all")
        last = self.bursts[-1]
        if last["low_hz"] is not None and last["hidden_m"] is not None:
            lines.append(
                f"waves longer than {1.0 / last['low_hz']:.0f} s, if there are any, are below {last['hidden_m']:.2f} m "
                "(last burst)"
            )
        elif "short" in last["tests"]:
            least = SEGMENTS * PERIODS / LONGEST_WAVES
            lines.append(
                f"a burst must last {least:.0f} s, or --low must say how slow the longest waves are (last burst)"
            )
        elif last["hidden_m"] is not None:
            lines.append(f"no wave stands above the noise: Hm0 is below {last['hidden_m']:.2f} m (last burst)")
        return "\n".join([*lines, *self._comparison_lines()])

    def _comparison_lines(self) -> Iterator[str]:
        """Lines of what the reference says, and of the differences from it."""
        if not self.reference:
            return
        apart = self.differences()
        titles = [f"{_stem(name)} [{name.rpartition('_')[2]}]" for name in apart]
        yield "\n" + f"{'reference (difference)':22}" + "".join(f"{title:>22}" for title in titles)
        for row, burst in enumerate(self.bursts[:_SHOWN]):
            cells = (f"{self.reference[name][row]:.2f} ({apart[name][row]:+.2f})" for name in apart)
            yield f"{burst['begin_utc']:22}" + "".join(f"{cell.replace('nan (+nan)', '-'):>22}" for cell in cells)
        for title, way in (("mean difference", np.mean), ("rms difference", _rms)):
            finite = [each[np.isfinite(each)] for each in apart.values()]
            yield f"{title:22}" + "".join(f"{way(each):>22.3f}" if each.size else f"{'-':>22}" for each in finite)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the bursts: ``.nc`` with their spectra, by the CF conventions; ``.csv`` or ``.parquet`` the numbers.

        Raises
        ------
        ParameterError
            If the path has another ending, or a file lies there and `overwrite` is not given.
        MissingExtraError
            If h5netcdf is not installed.
        """
        target = check.path("out", path)
        if target.suffix.lower() == ".nc":
            self._write_netcdf(target, overwrite)
            return
        if target.suffix.lower() not in TABLES:
            raise ParameterError(f"waves are written as .nc, {' or '.join(TABLES)}, but the file is {target}.")
        write_table(target, self.columns(), overwrite=overwrite)

    def _write_netcdf(self, target: Path, overwrite: bool) -> None:
        from plumbob.files.foreign.tables import CfVariable, utc_since, write_cf

        begins, lasted = np.array(self._begins()), self._durations()
        clock = utc_since(0) if self.is_utc else {"units": "s"}
        clock |= {"long_name": "middle of the burst", "bounds": "time_bnds"}
        f = {"units": "Hz", "standard_name": "wave_frequency", "long_name": "frequency"}
        bounds = CfVariable(("time", "nv"), np.stack((begins, begins + lasted), axis=1), {})
        variables = {
            "time": CfVariable(("time",), self.time, clock), "time_bnds": bounds,
            "freq": CfVariable(("freq",), self.frequency, f),
        }  # fmt: skip
        where = {"coordinates": "station" if self.place is None else "lat lon station"}
        for name, axis, unit, value in zip(
            ("lat", "lon"), ("latitude", "longitude"), ("degrees_north", "degrees_east"), self.place or (), strict=False
        ):
            about = {"units": unit, "standard_name": axis, "long_name": axis}
            variables[name] = CfVariable((), np.array(value), about)
        for table, dimensions, values in (
            (_BULK, ("time",), self._numbers), (_SPECTRAL, ("time", "freq"), self.spectrum),
        ):  # fmt: skip
            for name, (unit, standard, words) in table.items():
                about = {"units": unit, "long_name": words} | ({"standard_name": standard} if standard else {}) | where
                variables[_FILE_NAMES.get(name, _stem(name))] = CfVariable(dimensions, values(name), about)
        flags = {"standard_name": "aggregate_quality_flag", "long_name": "QARTOD flag of the burst", **where,
                 "flag_values": np.array([*MEANING], np.int8),
                 "flag_meanings": " ".join(word.replace(" ", "_") for word in MEANING.values())}  # fmt: skip
        variables["flag"] = CfVariable(("time",), np.array([each["flag"] for each in self.bursts], np.int8), flags)
        station = np.frombuffer(self.bursts[0]["recording"].encode(), "S1")
        named = {"cf_role": "timeseries_id", "long_name": "first recording"}
        variables["station"] = CfVariable(("name_strlen",), station, named)
        write_cf(target, variables, {
            "featureType": "timeSeries", "title": "sea states by burst",
            "source": f"acceleration of a floating unit, plumbob {__version__}",
            "history": "\n".join(map(str, self.notes)) or "computed from the recordings",
        }, overwrite=overwrite)  # fmt: skip


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _stem(name: str) -> str:
    """Name of a number without its unit."""
    return name if name in ("degrees_of_freedom", *_SPECTRAL) else name.rpartition("_")[0]


def waves(
    sources: Source | Iterable[Source],
    *,
    burst: float | str = "20 min",
    low: float | str | None = None,
    high: float | str = SHORTEST_WAVES,
    response: "str | Path | tuple[ArrayLike, ArrayLike] | None" = None,
    reference: str | Path | None = None,
    filter: str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: str | None = None,
    calibration: Any = None,
    noise: Any = None,
    place: str | None = None,
    date: str | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    jobs: int | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int | None], object] | None = None,
) -> Waves:
    """Say how high, long and from where waves were, burst by burst, by what a floating unit recorded.

    The attitude is estimated, gravity taken off, and the acceleration east, north and up gives the spectrum and its
    directions. Heights and periods are those of the unit's own way, which is the water's as far as its hull follows.

    Parameters
    ----------
    sources : path, URL, pattern, Recording or ImuData, or an iterable of them
        Recordings as of `plumbob.batch`, a folder of them, or the dataset of a batch that was run with `waves`.
    burst : float or str
        Length of a burst, s, or text with a unit.
    low, high : float or str, optional
        Frequencies from which to which waves count, Hz. Without `low`, from where they stand above the noise.
    response : path or pair of arrays, optional
        Frequencies, Hz, rising, and how much of a wave's height the hull rises there; as a CSV of these two columns.
    reference : path, optional
        Table of another buoy beside it, of Spotter, OpenMetBuoy, SFY, NDBC or Plumbob, as text, JSON or NetCDF: of each
        burst the row nearest in time is put beside it.
    filter, params, frame, calibration, noise, date, profile, unit : optional
        As of `plumbob.estimate`.
    place : str, optional
        ``LAT,LON[,HEIGHT]``: directions then count from true North.
    jobs : int, optional
        Processes for several recordings, as of `plumbob.batch`.
    out : path, optional
        Where to write them: ``.nc``, ``.csv`` or ``.parquet``, as `Waves.save` does.
    overwrite : bool
        Whether a file that lies there may be replaced.
    note : callable, optional
        Called with each remark.
    progress : callable, optional
        Called with the number of recordings that are over, and of all.

    Returns
    -------
    Waves

    Raises
    ------
    ParameterError
        If an option is wrong, or no recording holds waves.
    ShapeError, FrameError, CalibrationError, DecodeError
        As of `plumbob.estimate`, of a recording alone; of several, a note says which were left out.
    """
    say = note if note is not None else _silent
    if out is not None and check.path("out", out).suffix.lower() not in (".nc", *TABLES):
        raise ParameterError(f"waves are written as .nc, {' or '.join(TABLES)}, but the file is {out}.")
    settings = wave_settings(low=low, high=high, response=response, noise=noise)
    how = {
        "filter": filter, "params": params, "frame": frame, "noise": noise, "place": place, "date": date,
        "profile": profile, "unit": unit, "calibration": calibration,
    }  # fmt: skip
    if isinstance(sources, str | Path) and (Path(sources) / JOBS).is_dir():
        bursts, notes = _of_dataset(Path(sources))
    else:
        alone = isinstance(sources, str | os.PathLike | Recording | ImuData)
        listed: Any = [sources] if alone else list(sources)  # type: ignore[arg-type]
        items = [*listed_items(listed, say)[0]]
        if len(items) == 1 and not is_url(items[0].where):
            gatherer = make_gatherer(burst=burst, waves=settings)
            of_one = {name: value for name, value in how.items() if value is not None}
            subject = read_subject(items[0].source, gatherer, of_one, graded=False, note=say)
            bursts, notes = _of_statistics(items[0].name, subject.summary()), list(subject.remarks)
        else:
            with TemporaryDirectory(prefix="plumbob-") as folder:
                more: dict[str, Any] = {**how, "burst": burst, "jobs": jobs, "note": say, "progress": progress}
                batch(listed, folder, waves=settings, **more)
                bursts, notes = _of_dataset(Path(folder))
    if not bursts:
        raise ParameterError("no recording gave waves. Record an accelerometer on something that floats.")
    made = Waves(tuple(bursts), tuple(dict.fromkeys(notes)), None if place is None else _latitude_longitude(place))
    if reference is not None:
        made = made.compare(reference)
    if out is not None:
        made.save(out, overwrite=overwrite)
    return made


def _silent(_: str) -> None:
    pass


def wave_settings(
    *,
    low: float | str | None = None,
    high: float | str = SHORTEST_WAVES,
    response: "str | Path | tuple[ArrayLike, ArrayLike] | None" = None,
    noise: Any = None,
) -> WaveSettings:
    """Settings of what a user gives, as `waves` takes it; ParameterError where it is wrong."""
    first, last = given("low", low, Quantity.FREQUENCY), given("high", high, Quantity.FREQUENCY)
    assert last is not None
    if not (first if first is not None else LONGEST_WAVES) < last or (first is not None and first <= 0.0):
        raise ParameterError(
            f"waves must count from a low frequency above 0 to a higher one, but {low} to {high} was given."
        )
    card = given_noise(noise)
    level = 0.0 if card is None or card.acc is None else float(np.max(card.acc.n_rpsd))
    return WaveSettings(level, first, last, None if response is None else _response(response))


def _response(given_: "str | Path | tuple[ArrayLike, ArrayLike]") -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Frequencies and response of a hull, of arrays or of a CSV with one line of titles or none."""
    if isinstance(given_, str | Path):
        path = check.path("response", given_)
        try:
            rows = np.genfromtxt(path, delimiter=",", encoding="utf-8", ndmin=2)
            f, rises = rows[int(np.isnan(rows[0, 0])) :].T  # the first line may be titles
        except (OSError, ValueError, IndexError) as error:
            raise DecodeError(f"{path} must have two columns, frequency in Hz and response: {error}.") from error
    else:
        f, rises = (check.floats("response", part) for part in given_)
    if f.ndim != 1 or f.shape != rises.shape or f.size < 2 or not (np.diff(f) > 0.0).all() or not (rises >= 0.0).all():
        raise ParameterError(
            "response needs rising frequencies, Hz, and as many numbers of 0 or more: how much of a wave's height the "
            "hull rises."
        )
    return tuple(f.tolist()), tuple(rises.tolist())


def _latitude_longitude(place: str) -> tuple[float, float]:
    from plumbob.data.earth_field import parse_place

    latitude, longitude, _ = parse_place(place)
    return float(to_deg(latitude)), float(to_deg(longitude))


def _of_dataset(folder: Path) -> tuple[list[dict[str, Any]], list[Finding]]:
    """Bursts of a dataset, and which recordings are left out."""
    bursts: list[dict[str, Any]] = []
    notes: list[Finding] = []
    for path in sorted((folder / JOBS).glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        row = record["row"]
        if record["statistics"] is None:
            notes.append(warning("waves.left_out", recording=row["recording"], reason=row["reason"] or row["verdict"]))
            continue
        bursts += _of_statistics(row["recording"], record["statistics"])
    if not bursts and not notes:
        raise ParameterError(f"{folder} is a dataset without waves. Run the batch again with --waves.")
    return bursts, notes


def _of_statistics(name: str, statistics: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Bursts of a recording; their flag is the worst of the waves', the accelerometer's and the attitude's."""
    rows = []
    for burst in statistics["bursts"]:
        if (sea := burst.get("waves")) is None:
            continue
        tests = dict(sea["tests"])
        for channel in ("acc", "attitude"):
            if channel in burst["quality"]:
                tests |= {f"{channel} {test}": flag for test, flag in burst["quality"][channel]["tests"].items()}
        about = {"recording": name, **{key: burst[key] for key in ("begin_s", "end_s", "begin_utc")}}
        rows.append({**about, **sea, "tests": tests, "flag": max([sea["flag"], *tests.values()])})
    return rows
