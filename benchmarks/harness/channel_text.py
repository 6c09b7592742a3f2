"""Tables of the trackball paper's tests, as text."""

from collections.abc import Iterator, Mapping, Sequence

from benchmarks.harness.channel_records import STEP
from benchmarks.harness.channel_static import LONG, LONG_TAUS, SAMPLES, TAUS, WALK, StaticTest, degrees_of_freedom
from benchmarks.harness.channel_turntable import BIAS, OnTurntable
from plumbob.core.units import to_deg, to_dps


def static_lines(static: StaticTest) -> Iterator[str]:
    """Lines of the test at rest."""
    yield f"1  At rest, {SAMPLES} samples, scalar Kalman filter"
    yield f"{'':8}{'gain':>8}{'variance after/before':^38}{'angle':>8}"
    yield f"{'Q/R':8}{'K':>8}{'K/(2−K)':>11}{'white alone':>13}{'this record':>14}{'ratio':>8}"
    for one in static.filters:
        cells = f"{one.gain:8.4f}{one.theory:11.5f}{one.white:13.5f}{one.variance:14.5f}{one.angle:8.2f}"
        yield f"{one.q_over_r:<8g}{cells}"
    yield ""
    yield "   Allan deviation after/before, by averaging time"
    yield from _allan_lines(TAUS, SAMPLES, static.adev_before, [(o.q_over_r, o.adev) for o in static.filters])
    yield ""
    yield f"   {LONG / 3600:g} h at rest, with a random walk of the bias of {to_dps(WALK):g} °/s/√s besides"
    count = round(LONG / STEP)
    yield from _allan_lines(
        LONG_TAUS, count, static.adev_long_before, [(o.q_over_r, o.adev_long) for o in static.filters]
    )


def turntable_lines(scale: float, rows: Sequence[OnTurntable]) -> Iterator[str]:
    """Lines of the test on the turntable."""
    yield f"2  Turntable, 0 to 60 °/s in 100 s, then constant; bias {to_dps(BIAS):g} °/s, gain wrong by {scale:.0%}"
    yield f"{'':20}{'rms, °/s':^18}{'mean, °/s':^18}{'behind, °/s':^18}{'angle on':>9}"
    yield f"{'':20}{'ramp':>9}{'constant':>9}{'ramp':>9}{'constant':>9}{'measured':>9}{'theory':>9}{'ramp, °':>9}"
    for row in rows:
        rates = (row.ramp_rms, row.hold_rms, row.ramp_mean, row.hold_mean, row.lag, row.lag_theory)
        yield f"{row.name:20}{''.join(f'{to_dps(v):9.3f}' for v in rates)}{to_deg(row.angle):9.2f}"


def reading_lines(static: StaticTest, turntable: Mapping[float, Sequence[OnTurntable]]) -> Iterator[str]:
    """Lines that say what the tables show, and what the paper's own figures do not."""
    angles = [one.angle for one in static.filters]
    yield f"The integrated angle, which attitude is made of, keeps {min(angles):.0%} to {max(angles):.0%} of its error."
    middle = static.filters[len(static.filters) // 2]
    long = " and ".join(
        f"{v:.1%} at {tau:g} s" for tau, v in zip(LONG_TAUS, middle.adev_long, strict=True) if tau >= 100
    )
    yield f"Bias instability stays: Q/R={middle.q_over_r:g} leaves {long} of the Allan deviation."
    for scale, rows in turntable.items():
        raw, removed, *filtered = rows
        one_state = min(filtered[:-1], key=lambda row: row.ramp_rms)
        yield (
            f"Ramp, gain wrong by {scale:.0%}: {to_dps(raw.ramp_rms):.3f} °/s rms; without the bias "
            f"{to_dps(removed.ramp_rms):.3f}; best of the one-state filters and averages "
            f"{to_dps(one_state.ramp_rms):.3f}; two states {to_dps(filtered[-1].ramp_rms):.3f}."
        )
    yield "Lag hides a part of a gain error on a ramp; at constant rate no filter of a channel takes any of it off."


def _allan_lines(
    taus: Sequence[float], count: int, before: Sequence[float], ratios: Sequence[tuple[float, Sequence[float]]]
) -> Iterator[str]:
    yield f"{'τ, s':22}{''.join(f'{tau:8g}' for tau in taus)}"
    yield f"{'dof, white noise':22}{''.join(f'{degrees_of_freedom(count, tau):8.1f}' for tau in taus)}"
    yield f"{'before, °/s':22}{''.join(f'{to_dps(v):8.4f}' for v in before)}"
    for ratio, values in ratios:
        yield f"{f'ratio, Q/R={ratio:g}':22}{''.join(f'{v:8.3f}' for v in values)}"
