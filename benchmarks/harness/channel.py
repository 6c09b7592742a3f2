"""The trackball paper's tests of its rate filter [Chen2013], on simulated data, with what the paper does not show."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.channel_records import FLICKER, RATIOS, STEP, WHITE
from benchmarks.harness.channel_static import MEMORIES, TAUS, WALK, AtRest, StaticTest, measure_static
from benchmarks.harness.channel_text import reading_lines, static_lines, turntable_lines
from benchmarks.harness.channel_turntable import BIAS, SCALES, SETTLED, OnTurntable, measure_turntable
from plumbob.core.units import from_si, to_dps
from plumbob.filters.channel_scalar import steady_gain

PARTS = 1 + len(SCALES)
"""How many tests there are; each runs with every seed."""

_SHOWN = 1e-3  # the Q/R at which the bars are set


@dataclass(frozen=True, slots=True)
class ChannelTest:
    """Result of all tests.

    Attributes
    ----------
    seeds : int
        How many runs of each.
    static : StaticTest
        At rest.
    turntable : dict
        On the turntable, by error of the gain.
    """

    seeds: int
    static: StaticTest
    turntable: dict[float, tuple[OnTurntable, ...]]

    def bars(self) -> tuple[Bar, ...]:
        """Figures that a working filter and a true simulation must reach."""
        return (*_static_bars(self.static), *_turntable_bars({row.name: row for row in self.turntable[0.0]}))

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "seeds": self.seeds,
            "noise": {
                "white_dps": to_dps(WHITE),
                "flicker_deg_per_h": from_si(FLICKER, "deg/h"),
                "walk_dps_per_rts": to_dps(WALK),
                "bias_dps": to_dps(BIAS),
                "step_s": STEP,
            },
            "static": self.static.as_dict(),
            "turntable": [
                {"scale_error": scale, "filters": [row.as_dict() for row in rows]}
                for scale, rows in self.turntable.items()
            ],
            "bars": [bar.as_dict() for bar in self.bars()],
        }

    def text(self) -> str:
        """Tables of the tests, and how the bars are kept."""
        noise = f"white {to_dps(WHITE):g} °/s per sample, flicker {from_si(FLICKER, 'deg/h'):g} °/h"
        lines = [f"{self.seeds} seeds; {noise}; a sample every {STEP:g} s", "", *static_lines(self.static)]
        for scale, rows in self.turntable.items():
            lines += ["", *turntable_lines(scale, rows)]
        lines += ["", *reading_lines(self.static, self.turntable)]
        lines += ["", *bar_lines(self.bars())]
        return "\n".join(lines)


def measure_channel(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> ChannelTest:
    """Run every test with every seed.

    Parameters
    ----------
    seeds : sequence of int
        One run each.
    progress : callable, optional
        Called with 1 after each seed of each of `PARTS`.
    """
    static = measure_static(seeds, progress)
    return ChannelTest(len(seeds), static, {scale: measure_turntable(seeds, scale, progress) for scale in SCALES})


def _static_bars(static: StaticTest) -> tuple[Bar, ...]:
    shown: AtRest = next(one for one in static.filters if one.q_over_r == _SHOWN)
    white = max((one.white / one.theory for one in static.filters), key=lambda r: abs(r - 1.0))
    reduced = max(ratio for tau, ratio in zip(TAUS, shown.adev, strict=True) if tau <= 1.0)
    return (
        Bar("white noise: variance ratio over K/(2−K), worst", white, 0.8, 1.2),
        Bar(f"Q/R={_SHOWN:g}: Allan deviation ratio up to 1 s, worst", reduced, 0.0, 0.2),
        Bar(f"Q/R={_SHOWN:g}: Allan deviation ratio at 50 s", shown.adev[-1], 0.9, 1.1),
    )


def _turntable_bars(rows: dict[str, OnTurntable]) -> tuple[Bar, ...]:
    settled = [rows[f"scalar Q/R={q:g}"] for q in RATIOS if MEMORIES / steady_gain(q) <= SETTLED]
    lag = max((row.lag / row.lag_theory for row in settled), key=lambda r: abs(r - 1.0))
    two = rows["two states"]
    return (
        Bar("lag over αΔt(1−K)/K, worst of the settled", lag, 0.95, 1.05),
        Bar("two states: rms on the ramp, °/s", to_dps(two.ramp_rms), 0.0, 0.05),
        Bar("two states: rms at constant rate, °/s", to_dps(two.hold_rms), 0.0, 0.05),
        Bar("two states: mean on the ramp, °/s", to_dps(two.ramp_mean), -0.01, 0.01),
        Bar("two states: mean at constant rate, °/s", to_dps(two.hold_mean), -0.01, 0.01),
    )
