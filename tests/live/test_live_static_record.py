"""From files to channels for a noise analysis: recordings, bare numbers, and what contradicts itself."""

import math
from contextlib import suppress

import numpy as np
import pytest

from plumbob import Frame, ImuData, ImuMeta, files, simulate
from plumbob.core.errors import ClockError, DecodeError, ParameterError, ShapeError, UnitError
from plumbob.core.units import Quantity, dps, to_si
from plumbob.door.allan import load_static
from plumbob.noise import KINDS, Averager, deviation
from plumbob.noise import allan as module
from plumbob.noise.allan import changes, characterise, deviations
from plumbob.noise.static_record import check_static
from tests.helpers.real_data import DATA, needs

L3GD20 = DATA / "static_l3gd20" / "gyro2_x.txt"
TRIAL = DATA / "broad" / "03_undisturbed_slow_rotation_C.hdf5"
needs_l3gd20 = needs("static_l3gd20/gyro2_x.txt")
needs_broad = needs("broad/03_undisturbed_slow_rotation_C.hdf5")

ROWS, DT = 3000, 0.01


def make(rows=ROWS, **changes):
    rng = np.random.default_rng(3)
    gyr, acc, mag = (scatter * rng.normal(size=(rows, 3)) for scatter in (0.01, 0.02, 0.3))
    t = np.arange(rows) * DT + 5.0
    return {"t": t, "gyr": gyr, "acc": acc + [0.0, 0.0, 9.8], "mag": mag + [20.0, 0.0, -40.0]} | changes


@pytest.fixture
def recording(tmp_path):
    def written(**content):
        return files.write(tmp_path / "a.parquet", ImuData(**content), overwrite=True)

    return written


@pytest.fixture
def numbers(tmp_path):
    def written(values, name="a.txt", form="%.6f"):
        np.savetxt(tmp_path / name, values, fmt=form)
        return tmp_path / name

    return written


def test_a_recording_gives_its_triads(recording):
    content = make()
    record = load_static(recording(**content))
    quantities = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}
    for group, (triad, quantity) in zip(record.groups, quantities.items(), strict=True):
        assert group.names == tuple(f"{triad} {axis}" for axis in "xyz")
        assert group.quantity is quantity
        assert (group.dt, group.start) == (pytest.approx(DT, rel=1e-9), 5.0)
        assert np.array_equal(group.read(), content[triad])
        assert np.array_equal(np.concatenate(list(group.blocks())), content[triad])
    assert record.refused == {}
    assert any(str(note).startswith("sampling time 0.01 s from the time stamps") for note in record.notes)
    assert check_static(record).errors == ()
    assert check_static(record).still == pytest.approx((5.0, 35.0))


REFUSED = {
    "rate": ({"rate": 50.0}, "time stamps say 100 Hz, but the rate given is 50 Hz"),
    "triad": ({"triads": ("temp",)}, "has only gyr, acc, mag, but the analysis asks for temp"),
    "behind": ({"start": 40.0}, r"lasts from 5 s to 34\.99 s, so from 40.0 to None s it has 0"),
    "order": ({"start": 10.0, "stop": 10.0}, "start must be before stop"),
    "scale": ({"scale": "1 deg/s"}, "recording with units of its own; leave scale"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_part_that_a_recording_has_not_is_refused(recording, case):
    options, words = REFUSED[case]
    with pytest.raises(ParameterError, match=words):
        load_static(recording(**make()), **options)


def test_parts_milliseconds_and_jitter_of_a_recording(recording):
    content = make()
    (group,) = load_static(recording(**content), triads=("acc",), start=10.0, stop=20.0, rate=100.0).groups
    assert np.array_equal(group.read(), content["acc"][500:1500])
    assert group.start == 10.0
    # 285.7 Hz: steps of 3 and 4 ms, whose median is 4 ms and would be 14 % wrong
    t = np.round(np.arange(ROWS) * 0.0035 + 1e-9, 3)
    (group,) = load_static(recording(**make(t=t)), triads=("gyr",)).groups
    assert group.dt == pytest.approx(0.0035, rel=1e-3 / (ROWS * 0.0035))
    assert len(group.read()) == ROWS
    # steps from 2 to 18 ms, but each sample has its own place in time; the ends know the mean step
    record = load_static(recording(**make(t=jittered())))
    assert [len(group.read()) for group in record.groups] == [ROWS] * 3
    assert record.groups[0].dt == pytest.approx(DT, abs=0.008 / (ROWS - 1))
    assert str(record.notes[-1]).startswith("sampling time 0.0")
    assert "none missing; jitter 0.003" in str(record.notes[-1])  # 0.004 √(2/3) = 3.3 ms


@pytest.mark.parametrize("lost", [1, 200])
def test_a_gap_leaves_the_longest_stretch_and_says_so(recording, lost):
    content = make(ROWS)
    kept = np.delete(np.arange(ROWS), np.r_[1000 : 1000 + lost])
    record = load_static(recording(**{name: values[kept] for name, values in content.items()}))
    assert np.array_equal(record.groups[0].read(), content["gyr"][1000 + lost :])
    assert record.groups[0].start == pytest.approx(5.0 + (1000 + lost) * DT)
    (note,) = [str(note) for note in record.notes if "samples are missing at" in str(note)]
    assert "at 1 place (the first after 14.99 s" in note
    assert f"{5.0 + (1000 + lost) * DT:g} s to 34.99 s, is used" in note


BURSTS = np.floor(np.arange(ROWS) / 4) * 4 * DT + (np.arange(ROWS) % 4) * 4e-4
"""Rows of 100 Hz that come in fours, 0.4 ms apart, as a radio or a buffer hands them over."""


@pytest.mark.parametrize(("t", "words"), [
    (np.cumsum(np.random.default_rng(4).uniform(0.001, 0.014, ROWS)), "the steps between samples scatter by"),
    (BURSTS, 'come in bursts: .*3000 rows in .* one every 0\\.00999(.|\n)*with rate = "100'),
], ids=["uneven", "bursts"])  # fmt: skip
def test_uneven_samples_are_refused_with_what_to_declare(recording, t, words):
    with pytest.raises(ClockError, match=words):
        load_static(recording(**make(t=t)))


def jittered():
    return np.arange(ROWS) * DT + np.random.default_rng(10).uniform(-0.004, 0.004, ROWS)


@pytest.mark.parametrize("scatter", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("lost", ["one", "5 %", "every 20th"])
def test_lost_rows_are_seen_beside_jitter(recording, scatter, lost):
    gone = {"one": [1000], "5 %": np.random.default_rng(11).random(ROWS) < 0.05, "every 20th": slice(10, None, 20)}
    kept = np.delete(np.arange(ROWS), gone[lost])
    t = np.arange(ROWS) * DT + scatter * (jittered() - np.arange(ROWS) * DT)
    with suppress(ClockError):
        record = load_static(recording(**make(kept.size, t=t[kept])), triads=("gyr",))
        assert sum("samples are missing at" in str(note) for note in record.notes) == 1


@pytest.mark.parametrize(("there", "reason"), [
    (np.arange(ROWS) % 4 != 3, "comes unevenly, 2250 values in 3000 rows, at most 3 of them evenly"),
    (np.random.default_rng(5).random(ROWS) < 0.1, "comes unevenly"),
], ids=["three quarters", "as it likes"])  # fmt: skip
def test_a_magnetometer_that_comes_unevenly_is_refused_alone(recording, there, reason):
    content = make()
    path = recording(**content | {"mag": np.where(there[:, np.newaxis], content["mag"], np.nan)})
    record = load_static(path)
    assert [group.names[0] for group in record.groups] == ["gyr x", "acc x"]
    assert record.refused["mag"].startswith(reason)
    assert check_static(record).errors == ()
    with pytest.raises(ShapeError, match="no sensor can be used: mag comes unevenly"):
        load_static(path, triads=("mag",))


@pytest.mark.parametrize("every", [4, 2.857, 3.1])
def test_a_slower_magnetometer_keeps_its_own_rate(recording, every):
    places = np.ceil(np.arange(int(ROWS / every)) * every).astype(int)
    content = make()
    mag = np.full((ROWS, 3), np.nan)
    mag[places] = content["mag"][places]
    record = load_static(recording(**content | {"mag": mag}))
    group = record.groups[2]
    assert np.array_equal(group.read(), content["mag"][places])
    assert group.dt == pytest.approx(every * DT, rel=every / ROWS)
    assert record.groups[0].dt == pytest.approx(DT)
    assert any("mag comes every" in str(note) and "its own rate" in str(note) for note in record.notes)


def test_lost_rows_a_missing_axis_and_a_clipped_channel(recording):
    content = make()
    content["gyr"][[700, 701, 900]] = np.nan
    content["acc"][:, 1] = np.nan
    record = load_static(recording(**content, meta=ImuMeta(unit_check=False)))
    assert np.array_equal(record.groups[0].read(), content["gyr"][901:])
    assert any(str(note).startswith("gyr lacks values at 2 places") for note in record.notes)
    assert record.groups[1].names == ("acc x", "acc z")
    assert record.refused == {"acc y": "has no value"}
    content = make()
    content["gyr"][[5, 6], 1] = dps(250.0)
    record = load_static(recording(**content, meta=ImuMeta(gyr_range=dps(250.0))))
    assert record.groups[0].names == ("gyr x", "gyr z")
    assert record.refused == {"gyr y": "is at the end of its range in 2 of 3000 samples"}


@needs_broad
def test_a_trial_moves_and_its_start_does_not():
    record = load_static(TRIAL)
    report = check_static(record)
    assert {finding.kind for finding in report.errors} == {"moving"}
    start, stop = report.still
    assert start == 0.0
    assert 35.0 < stop < 45.7  # the data set's own movement phase begins at 45.7 s
    assert str(report.errors[0].finding).endswith(
        f"the longest still stretch is --from 0s --to {np.floor(10 * stop) / 10:g}s."
    )
    again = check_static(load_static(TRIAL, start=0.0, stop=np.floor(10 * stop) / 10))
    assert again.errors == ()
    assert again.steps["gyr x"] == pytest.approx(dps(2000.0 / 2**15), rel=1e-3)  # 16 bits for ±2000 °/s


@pytest.mark.parametrize(("options", "error", "words"), [
    ({}, ParameterError, r"their rate .* and their scale \(such as .0.00875 deg/s. for counts"),
    ({"scale": "1"}, ParameterError, r"give their rate \(samples per second\)\. For a"),
    ({"rate": 100.0}, ParameterError, r"give their scale .*give --profile FILE.toml instead"),
    ({"rate": 0.0, "scale": "1"}, ParameterError, "rate must be a positive number"),
    ({"rate": 100.0, "scale": "1 furlong"}, UnitError, "is not a unit"),
    ({"rate": 100.0, "scale": "1 V"}, UnitError, "is of voltage, but must be of rate"),
    ({"rate": 100.0, "scale": "0 deg/s"}, UnitError, "must be more than 0"),
])  # fmt: skip
def test_numbers_need_a_rate_and_a_scale(numbers, options, error, words):
    with pytest.raises(error, match=words):
        load_static(numbers(np.zeros((5, 2))), **options)


@pytest.mark.parametrize(("scale", "quantity", "factor"), [
    ("0.00875 deg/s", Quantity.RATE, np.radians(0.00875)),
    ("0.061 mg", Quantity.ACCELERATION, 0.061 * 9.80665e-3),
    ("1.5 mgauss", Quantity.FIELD, 0.15),
    ("1", Quantity.RATIO, 1.0),
])  # fmt: skip
def test_counts_become_inside_units(numbers, scale, quantity, factor):
    counts = np.random.default_rng(6).integers(-50, 50, (1200, 2))
    record = load_static(numbers(counts, form="%d"), rate=200.0, scale=scale)
    (group,) = record.groups
    assert group.names == ("column 1", "column 2")
    assert group.quantity is quantity
    assert (group.dt, group.read()) == (0.005, pytest.approx(counts * factor, rel=1e-15))
    assert record.notes == ()


def test_a_part_of_the_numbers_and_progress(tmp_path):
    values = np.random.default_rng(7).normal(size=(700_000, 1)).astype("<f4")
    values.tofile(tmp_path / "a.f32")
    record = load_static(tmp_path / "a.f32", rate=1000.0, scale="1 m/s2", columns=1, start=10.0, stop=600.0)
    (group,) = record.groups
    assert (group.names, group.start) == (("a",), 10.0)
    assert np.array_equal(group.read(), values[10_000:600_000].astype(float))
    progress = []
    assert sum(len(block) for block in group.blocks(progress.append)) == 590_000
    assert progress == sorted(progress)
    assert progress[-1] <= record.size == 2_800_000


def test_numbers_that_are_scaled_already(numbers):
    counts = np.random.default_rng(8).normal(0.0, 50.0, 5000).round()
    path = numbers(counts * 0.00875)
    with pytest.raises(UnitError, match=r"multiples of 0.00875.*scaled already.*scale is '1 deg/s'.*file of counts"):
        load_static(path, rate=100.0, scale="0.00875 deg/s")
    (note,) = load_static(path, rate=100.0, scale="0.01 deg/s").notes
    assert note.startswith("the numbers are not whole counts, but the scale is 0.01 deg/s")
    assert len(load_static(path, rate=100.0, scale="1 deg/s").notes) == 0
    assert len(load_static(numbers(counts, form="%d"), rate=100.0, scale="0.00875 deg/s").notes) == 0


def test_a_profile_makes_a_recording_of_a_text(tmp_path):
    content = make()
    path = files.write(tmp_path / "a.csv", ImuData(**content))
    record = load_static(path)  # its profile lies beside it
    assert [group.names[0] for group in record.groups] == ["gyr x", "acc x", "mag x"]
    path.with_suffix(".profile.toml").rename(tmp_path / "b.toml")
    assert len(load_static(path, profile=tmp_path / "b.toml").groups) == 3
    with pytest.raises(DecodeError, match=r"is not a number with.*--profile FILE.toml"):
        load_static(path, rate=100.0, scale="1")


def test_findings_come_with_the_file_s_own_time(numbers):
    values = np.random.default_rng(9).normal(size=6000)
    values[3000:] += 20.0
    report = check_static(load_static(numbers(values), rate=100.0, scale="1", start=10.0))
    assert [finding.kind for finding in report.errors] == ["moving"]
    assert report.moving[0][0] == pytest.approx(30.0, abs=2.0)
    values[5000] = np.nan
    report = check_static(load_static(numbers(values), rate=100.0, scale="1"))
    assert [finding.kind for finding in report.errors] == ["not_finite"]


@needs_l3gd20
def test_a_real_file_on_one_line():
    with pytest.raises(UnitError, match="scaled already"):
        load_static(L3GD20, rate=100.0, scale="0.00875 deg/s")
    record = load_static(L3GD20, rate=100.0, scale="1 deg/s")
    report = check_static(record)
    assert report.findings == ()
    assert report.steps["gyro2_x"] == pytest.approx(dps(0.00875), rel=1e-6)  # sheet of the L3GD20, ±250 °/s
    assert report.still == (0.0, pytest.approx(len(record.groups[0].read()) / 100.0))


@pytest.fixture(scope="module")
def two_columns(tmp_path_factory):
    """Two columns of white noise and random walk, in a file of bare numbers."""
    path = tmp_path_factory.mktemp("characterise") / "two.npy"
    rng = np.random.default_rng(5)
    np.save(path, rng.standard_normal((60_000, 2)) + 0.01 * np.cumsum(rng.standard_normal((60_000, 2)), axis=0))
    return path


def opened(path, **options):
    record = load_static(path, rate=100.0, scale="1", **options)
    return record, check_static(record)


def test_a_file_larger_than_memory_gives_what_memory_gives(two_columns, monkeypatch):
    """Deviations to rounding below 2¹⁴ samples; coefficients are of averages then, and differ by less than their ±."""
    whole = characterise(*opened(two_columns))
    monkeypatch.setattr(module, "IN_MEMORY", 0)
    monkeypatch.setattr(module, "Averager", lambda channels: Averager(channels, kept=1 << 14))
    told = []
    streamed = characterise(*opened(two_columns), progress=lambda *counts: told.append(counts))
    assert told[-1] == (two_columns.stat().st_size,) * 2
    for a, b in zip(whole, streamed, strict=True):
        short = a.curve.n < 1 << 14
        assert b.curve.dev[: short.sum()] == pytest.approx(a.curve.dev[short], rel=1e-9)
        assert (b.mean, b.sd) == (pytest.approx(a.mean, abs=1e-9), pytest.approx(a.sd, rel=1e-4))
        for letter in ("N", "K"):
            x, y = a.terms[letter], b.terms[letter]
            assert abs(x.value - y.value) <= y.hi - y.lo
        assert not b.terms["Q"].observable


def test_means_of_a_stream_do_not_depend_on_its_blocks():
    x = np.random.default_rng(6).standard_normal((10_007, 2))
    for sizes in ((10_007,), (1, 0, 3, 9_000, 1_003)):
        averager = Averager(2, kept=1000)
        for block in np.split(x, np.cumsum(sizes)[:-1]):
            averager.feed(block)
        assert averager.averaged == 16
        expected = x[: 10_007 // 16 * 16].reshape(-1, 16, 2).mean(axis=1)
        assert np.abs(averager.values() - expected).max() < 1e-14


@pytest.mark.parametrize("limit", [0, 1 << 24])
def test_chosen_averaging_times(two_columns, monkeypatch, limit):
    monkeypatch.setattr(module, "IN_MEMORY", limit)
    found = characterise(*opened(two_columns), taus=[0.1, 1.0, 20.0])[0]
    assert found.curve.n.tolist() == [10, 100, 2000]
    assert found.curve.dev == pytest.approx(deviation(np.load(two_columns)[:, 0], [10, 100, 2000]), rel=1e-9)
    for tau, words in ((301.0, "τ = 301 s is too long: .* has 300 s at most"), (0.001, "the nearest is 0.01 s")):
        with pytest.raises(ParameterError, match=words):
            characterise(*opened(two_columns), taus=[tau])


def test_every_averaging_time_and_another_kind(two_columns, tmp_path):
    curve = characterise(*opened(two_columns), taus="all")[1].curve
    assert curve.n.tolist() == list(range(1, 30_001))
    assert curve.dev[[0, 99, 29_999]] == pytest.approx(
        deviation(np.load(two_columns)[:, 1], [1, 100, 30_000]), rel=1e-11
    )
    np.save(tmp_path / "short.npy", np.load(two_columns)[:1001])
    shared = changes(opened(tmp_path / "short.npy"), opened(two_columns), taus="all")["column 1"]
    assert shared.before.n.tolist() == shared.after.n.tolist() == list(range(1, 501))  # which the shorter one has
    first, second = deviations(*opened(two_columns), "ohdev", taus=[1.0])
    assert (first.name, second.name) == ("column 1", "column 2")
    assert first.curve.dev == pytest.approx(deviation(np.load(two_columns)[:, 0], [100], "ohdev"), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1000, 1001])
def test_every_averaging_time_of_every_kind(tmp_path, kind, count):
    """Three averages where a kind takes third differences or averages its second ones, and two otherwise."""
    np.save(tmp_path / "x.npy", np.random.default_rng(0).standard_normal(count))
    opening = opened(tmp_path / "x.npy")
    (found,) = deviations(*opening, kind, taus="all")
    longest = {"mdev": (count + 1) // 3, "ohdev": count // 3, "hdev": count // 3}.get(kind, count // 2)
    assert found.curve.n.tolist() == list(range(1, longest + 1))
    with pytest.raises(ParameterError, match=rf"for {kind}, a record of .* has {longest / 100:.6g} s at most"):
        deviations(*opening, kind, taus=[(longest + 1) / 100])


def moved(path):
    np.save(path, np.random.default_rng(7).standard_normal(20_000) + 50.0 * (np.arange(20_000) > 9_000))
    return path


def test_what_is_not_analysed(two_columns, tmp_path):
    """Only like is compared with like; a comma in a file's name does no harm to findings about several channels."""
    one, comma = tmp_path / "one.npy", tmp_path / "desk, 2.txt"
    np.save(one, np.load(two_columns)[:, 0])
    np.savetxt(comma, np.full(5000, 3.0))
    slower = load_static(one, rate=50.0, scale="1")
    assert changes(opened(two_columns), opened(one)) == changes(opened(one), (slower, check_static(slower))) == {}
    assert check_static(load_static(comma, rate=100.0, scale="1")).refused("desk, 2")
    for analyse, words in (
        (lambda: characterise(*opened(moved(tmp_path / "moved.npy"))), "not a static record"),
        (lambda: characterise(*opened(comma)), "not a static record: desk, 2: all 5000 values are 3"),
    ):
        with pytest.raises(ShapeError, match=words):
            analyse()


def test_the_simulator_s_noise_comes_back(tmp_path):
    """N, B and K of a unit's card, planted by `sim`, are found within three halves of their intervals."""
    setting = {"sensors": "mpu6000", "unit": "random", "seed": 3, "rate": 50.0, "duration": 3600.0}
    simulated = simulate("static", frame=Frame.ENU, **setting)
    record = load_static(files.write(tmp_path / "static.parquet", simulated.imu))
    steps = {"gyr": to_si(1 / 131, "deg/s"), "acc": to_si(1 / 8192, "g")}
    for analysis in characterise(record, check_static(record)):
        triad, axis = getattr(simulated.noise, analysis.name[:3]), "xyz".index(analysis.name[-1])
        for letter, planted in (("N", triad.n_rpsd), ("B", triad.b), ("K", triad.k_rpsd)):
            c, value = analysis.terms[letter], float(planted[axis])
            if value > 0.0 and c.observable:
                assert abs(math.log(c.value / value)) <= 3.0 * math.log(c.hi / c.lo) / 2.0, (analysis.name, letter)
            else:
                assert not c.observable and c.upper >= 0.5 * value, (analysis.name, letter)
        assert analysis.step == pytest.approx(steps[analysis.name[:3]], rel=1e-3)
