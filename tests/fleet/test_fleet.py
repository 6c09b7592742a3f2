"""A batch of recordings: verdicts, the same bits by any number of workers, and going on after any end."""

import csv
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import CalibrationError, DecodeError, LineError, ParameterError
from plumbob.fleet import workers
from plumbob.fleet.batch import load_cards, locked
from plumbob.fleet.items import Item, batch_items, input_digest
from plumbob.fleet.job import COLUMNS, BatchSettings
from plumbob.fleet.urls import fetched
from plumbob.quality.quality import MEANING
from tests.helpers import until
from tests.helpers.commandline import plumbob as call

SETTINGS = {"filter": "mahony"}
GOOD, BAD = 9, {"cut.parquet": "damaged", "empty.parquet": "damaged", "late.csv": "damaged"}
SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}


def made(seed, duration=6.0):
    found = plumbob.simulate("buoy", duration=duration, seed=seed, lost=0.42 if seed == 1 else 0.0, **SIM)
    return plumbob.Recording(imu=found.imu, track=found.truth, name=f"r{seed}")


def filled(root, duration=6.0):
    """A folder of recordings of so many seconds, some damaged."""
    (root / "deep").mkdir(parents=True)
    for seed in range(GOOD):
        plumbob.write(root / ("deep" if seed % 3 == 0 else "") / f"r{seed}.parquet", made(seed, duration))
    whole = (root / "r1.parquet").read_bytes()
    (root / "cut.parquet").write_bytes(whole[: len(whole) // 2])
    (root / "empty.parquet").write_bytes(b"")
    (root / "late.csv").write_bytes(whole)
    (root / "notes.doc").write_text("not a recording")
    return root


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return filled(tmp_path_factory.mktemp("fleet") / "in")


@pytest.fixture(scope="module")
def dataset(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("fleet") / "out"
    return plumbob.batch(folder, out, jobs=1, **SETTINGS), out


@pytest.fixture(scope="module")
def lasting(tmp_path_factory):
    """A folder whose batch lasts longer than a signal to it on a busy machine, and that batch."""
    root = tmp_path_factory.mktemp("lasting")
    folder = filled(root / "in", 200.0)
    return folder, plumbob.batch(folder, root / "out", jobs=1, **SETTINGS), root / "out"


@pytest.fixture
def memory():
    return pytest.importorskip("fsspec", reason="fsspec is not installed").filesystem("memory")


def upload(memory, folder, where, *names):
    for name in names:
        memory.pipe_file(f"{where}/{name}", (folder / name).read_bytes())


def parts(root):
    return {path.parent.name: path.read_bytes() for path in root.glob("attitude/*/part.parquet")}


def in_memory(folder, *names):
    return [replace(plumbob.read(folder / name), name=name) for name in names]


def verdicts(rows):
    return {row["recording"]: row["verdict"] for row in rows}


def test_each_recording_has_a_row_and_a_damaged_one_is_not_the_end(dataset):
    done, out = dataset
    assert done.counts == {"done": GOOD, "refused": 0, "damaged": 3, "failed": 0}
    found = verdicts(done.rows())
    assert found.items() >= BAD.items()
    good = sorted(f"{'' if seed % 3 else 'deep/'}r{seed}.parquet" for seed in range(GOOD))
    assert [name for name, verdict in found.items() if verdict == "done"] == good and len(parts(out)) == GOOD
    assert all(row["reason"] for row in done.rows() if row["verdict"] != "done")


def test_bits_do_not_depend_on_the_number_of_processes(folder, dataset, tmp_path, monkeypatch):
    for out, executable in (("processes", sys.executable), ("here", "")):  # where no process can be started
        monkeypatch.setattr(sys, "executable", executable)
        assert plumbob.batch(folder, tmp_path / out, jobs=3, **SETTINGS).counts == dataset[0].counts
        assert parts(tmp_path / out) == parts(dataset[1])


def test_a_part_is_what_estimate_writes_and_a_row_what_report_and_evaluate_say(folder, dataset):
    done, out = dataset
    file = folder / "r1.parquet"
    track = plumbob.read(out / "attitude/recording=r1.parquet/part.parquet").track
    expected = plumbob.estimate(file, "mahony")
    assert track.q_nb.tobytes() == expected.track.q_nb.tobytes()
    row = next(row for row in done.rows() if row["recording"] == "r1.parquet")
    assert row["total_rmse_deg"] == plumbob.evaluate(expected, file).summary()["total_rmse_deg"]
    said = plumbob.report(file, filter="mahony").summary()["recordings"][0]
    assert row["roll_std_deg"] == said["tilt"]["roll"]["std_deg"]
    assert row["inclination_greatest_deg"] == said["tilt"]["inclination"]["greatest_deg"]
    assert row["heading_mean_deg"] == said["heading"]["mean_deg"]
    assert row["samples"] == said["time"]["samples"] < 600 and row["rate_hz"] == pytest.approx(100.0)
    assert row["missing_samples"] == said["time"]["missing_samples"] > 0 and row["gaps"] == said["time"]["gaps"] > 0
    assert row["gap_share"] == said["time"]["lost_share"] > 0.0
    worst = partial(min, key=(4, 3, 9, 2, 1).index)  # of QARTOD's: fail, suspect, missing, not evaluated, pass
    bursts = [burst["quality"] for burst in said["bursts"]]
    flags = {name: worst(burst[name]["flag"] for burst in bursts) for name in bursts[0]}
    assert row["grades"] == ", ".join(f"{name} {MEANING[flag]}" for name, flag in flags.items())
    assert row["grade"] == MEANING[worst(flags.values())]
    record = json.loads((out / "_jobs/r1.parquet.json").read_text())
    assert record["statistics"]["tilt"]["roll"]["std_deg"] == row["roll_std_deg"]
    assert len(json.dumps(record)) < 20_000


def test_other_tools_read_the_dataset(dataset):
    import pyarrow.csv
    import pyarrow.dataset
    import pyarrow.parquet as pq

    out = dataset[1]
    table = pyarrow.dataset.dataset(out / "attitude", partitioning="hive").to_table()
    assert table.num_rows == sum(row["samples"] or 0 for row in dataset[0].rows())
    assert "deep/r0.parquet" in set(table["recording"].to_pylist())
    rows = pq.read_table(out / "verdicts.parquet")
    assert rows.column_names == list(COLUMNS) and rows.num_rows == GOOD + 3
    assert pyarrow.csv.read_csv(out / "verdicts.csv").num_rows == GOOD + 3


def test_a_second_run_makes_nothing_again(folder, dataset):
    out = dataset[1]
    before = {path: path.stat().st_mtime_ns for path in out.rglob("part.parquet")}
    table = (out / "verdicts.csv").read_bytes()
    assert plumbob.batch(folder, out, jobs=1, **SETTINGS).skipped == GOOD + 3
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert (out / "verdicts.csv").read_bytes() == table


def test_what_changed_is_made_again(tmp_path):
    (tmp_path / "in").mkdir()
    for seed in (1, 2):
        plumbob.write(tmp_path / "in" / f"r{seed}.parquet", made(seed))
    out = tmp_path / "out"
    plumbob.batch(tmp_path / "in", out, jobs=1, **SETTINGS)
    first = parts(out)
    plumbob.write(tmp_path / "in" / "r2.parquet", made(3), overwrite=True)
    assert plumbob.batch(tmp_path / "in", out, jobs=1, **SETTINGS).skipped == 1
    assert [first[name] == content for name, content in sorted(parts(out).items())] == [True, False]
    assert plumbob.batch(tmp_path / "in", out, params={"kp": 0.9}, jobs=1, **SETTINGS).skipped == 0
    assert parts(out)["recording=r1.parquet"] != first["recording=r1.parquet"]
    part = out / "attitude/recording=r1.parquet/part.parquet"
    whole = part.read_bytes()
    part.write_bytes(whole[:-1])  # it is not what its record says
    assert plumbob.batch(tmp_path / "in", out, params={"kp": 0.9}, jobs=1, **SETTINGS).skipped == 1
    assert part.read_bytes() == whole
    (tmp_path / "in" / "r1.parquet").write_bytes(b"cut")
    damaged = plumbob.batch(tmp_path / "in", out, params={"kp": 0.9}, jobs=1, **SETTINGS)
    assert (damaged.skipped, damaged.counts["damaged"]) == (1, 1)
    assert list(parts(out)) == ["recording=r2.parquet"]


def test_a_profile_beside_a_table_is_input_too(tmp_path):
    table, profile, out = tmp_path / "in/r.csv", tmp_path / "in/r.profile.toml", tmp_path / "out"
    table.parent.mkdir()
    plumbob.write(table, made(1).imu)
    assert plumbob.batch(table.parent, out, **SETTINGS).rows()[0]["device"] == "mpu6000+hmc5983 #1"
    assert plumbob.batch(table.parent, out, **SETTINGS).skipped == 1
    profile.write_text(profile.read_text().replace("hmc5983 #1", "hmc5983 #2"))
    again = plumbob.batch(table.parent, out, **SETTINGS)
    assert (again.skipped, again.rows()[0]["device"]) == (0, "mpu6000+hmc5983 #2")


def test_a_part_of_a_stream_is_read_with_its_first_one(tmp_path):
    for name in ("s.mcap", "s.0002.mcap", "t.0002.mcap"):
        (tmp_path / name).write_bytes(name.encode())
    assert [item.name for item in batch_items(tmp_path, print)] == ["s.mcap", "t.0002.mcap"]
    before = input_digest(tmp_path / "s.mcap")
    (tmp_path / "s.0002.mcap").write_bytes(b"another")
    assert input_digest(tmp_path / "s.mcap") != before


def children_of(pid):
    return [int(child) for path in Path(f"/proc/{pid}/task").glob("*/children") for child in path.read_text().split()]


def lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform == "win32", reason="the system has no SIGKILL")
@pytest.mark.parametrize(("name", "code", "jobs"), [("SIGTERM", 143, 1), ("SIGKILL", -9, 2), ("SIGINT", 130, 2)])
def test_a_killed_run_leaves_whole_files_and_no_process_and_goes_on(lasting, tmp_path, name, code, jobs):
    (folder, *dataset), out = lasting, tmp_path / "out"
    words = [sys.executable, "-m", "plumbob", "batch", folder, "--out", out, "--filter", "mahony", "--jobs", str(jobs)]
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    until(lambda: len(list(out.glob("_jobs/*.json"))) >= 2 or child.poll() is not None, "no recording is done")
    linux = sys.platform == "linux" and jobs > 1
    workers = children_of(child.pid) if linux else []
    (os.killpg if name == "SIGINT" else os.kill)(child.pid, getattr(signal, name))  # as a terminal does
    assert child.wait() == code
    assert bool(workers) == linux
    until(lambda: not any(map(lives, workers)), "a worker lives on")
    records = len(list(out.glob("_jobs/*.json")))
    assert 2 <= records < GOOD + 3
    expected = parts(dataset[1])
    assert parts(out).items() <= expected.items()
    done = plumbob.batch(folder, out, jobs=1, **SETTINGS)
    assert done.skipped >= records and done.counts == dataset[0].counts
    assert parts(out) == expected
    assert not list(out.rglob("*.tmp"))


class Deadly(plumbob.Recording):
    """A recording that ends the process to which it is handed over, as the system does where memory runs out."""

    def __reduce__(self):
        return eval, ("__import__('os').kill(__import__('os').getpid(), 9)",)


@pytest.mark.skipif(sys.platform == "win32", reason="the system has no SIGKILL")
def test_the_job_of_a_process_that_is_killed_has_failed_and_the_rest_goes_on(folder, dataset, tmp_path):
    out, lost = tmp_path / "out", ["r1.parquet", "r2.parquet"]
    given = in_memory(folder, *lost, "r4.parquet", "r5.parquet")
    deadly = [Deadly(**vars(recording)) for recording in given[:2]]
    done = plumbob.batch([*deadly, *given[2:]], out, jobs=2, **SETTINGS)
    assert done.counts == {"done": 2, "refused": 0, "damaged": 0, "failed": 2}
    reasons = {row["recording"]: row["reason"] for row in done.rows() if row["verdict"] == "failed"}
    assert list(reasons) == lost
    assert all("SIGKILL, as the system does where memory runs out; the next run" in why for why in reasons.values())
    assert plumbob.batch(given, out, jobs=1, **SETTINGS).skipped == 2 and len(parts(out)) == 4
    assert parts(out).items() <= parts(dataset[1]).items()
    assert sys.platform != "linux" or not children_of(os.getpid())


def test_a_script_needs_no_main_guard_and_prints_of_a_process_do_no_harm(folder, dataset, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(f"""
import plumbob

class Own(plumbob.Recording):  # known here alone; to ask for it prints
    def __reduce__(self):
        return eval, ("print(1, flush=True) or __main__.Own",)

given = [vars(plumbob.read(f"{folder}/{{name}}")) | {{"name": name}} for name in ("r1.parquet", "r2.parquet")]
given = plumbob.Recording(**given[0]), Own(**given[1])
print(plumbob.batch(given, {str(tmp_path / "out")!r}, filter="mahony", jobs=2).counts["done"], __name__)
""")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, env=environment)
    assert (done.stdout.splitlines(), done.stderr) == (["2 __main__"], "1\n")
    assert parts(tmp_path / "out").items() <= parts(dataset[1]).items()


def test_an_error_of_a_process_is_that_of_the_batch(folder, tmp_path):
    (tmp_path / "out/_jobs/r1.parquet.json").mkdir(parents=True)
    with pytest.raises(DecodeError, match=r"r1\.parquet\.json cannot be written: it is a folder") as raised:
        plumbob.batch([folder / "r1.parquet", folder / "r2.parquet"], tmp_path / "out", jobs=2, **SETTINGS)
    assert "run_job" in raised.value.__notes__[0]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system does not say what processors are given")
def test_by_default_there_are_as_many_processes_as_processors(folder, tmp_path, monkeypatch):
    made, start, children, popen = [], workers.processes, [], workers.Popen
    monkeypatch.setattr(workers, "Popen", lambda *given, **how: children.append(popen(*given, **how)) or children[-1])
    monkeypatch.setattr(workers, "processes", lambda jobs: (made.append(jobs), start(jobs))[1])
    for processors in ({0}, {0, 1}):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, given=processors: given)
        plumbob.batch([folder / "r1.parquet", folder / "r2.parquet"], tmp_path / f"{processors}", **SETTINGS)
    assert made == [1, 2]
    assert children and not any(child.returncode for child in children)  # asked to end, and not killed


def test_a_place_that_is_in_use_or_holds_other_files_is_refused(folder, tmp_path):
    with locked(tmp_path / "out"), pytest.raises(ParameterError, match=f"process {os.getpid()} on"):
        plumbob.batch(folder, tmp_path / "out", **SETTINGS)
    before = sorted(folder.iterdir())
    with pytest.raises(ParameterError, match="holds other files"):
        plumbob.batch(folder, folder, **SETTINGS)
    assert sorted(folder.iterdir()) == before
    (tmp_path / "out/verdicts.csv").mkdir()
    with locked(tmp_path / "other"):
        (tmp_path / "other/attitude").write_text("")
    (tmp_path / "file").write_text("")
    wrong = {"out": "verdicts.csv cannot be written: it is a folder", "file/out": "out cannot be", "other": "attitude"}
    for out, why in wrong.items():
        with pytest.raises(DecodeError, match=why):
            plumbob.batch(folder, tmp_path / out, **SETTINGS)
    assert not list(tmp_path.rglob("_jobs/*.json"))


def test_a_row_has_its_times_in_utc_and_a_spreadsheet_takes_no_cell_for_a_formula(tmp_path):
    recording, out = made(1), tmp_path / "out"
    meta = replace(recording.imu.meta, device="=1+1", t0_ns=1_767_225_600_000_000_000)
    named = replace(recording, imu=recording.imu.corrected(meta=meta), name="@sum, r")
    (row,) = plumbob.batch(named, out, **SETTINGS).rows()
    assert (row["begin_utc"], row["end_utc"]) == ("2026-01-01T00:00:00Z", "2026-01-01T00:00:05Z")
    (cells,) = csv.DictReader((out / "verdicts.csv").read_text().splitlines())
    assert (cells["device"], cells["recording"]) == ("'=1+1", "'@sum, r")
    assert float(cells["roll_mean_deg"]) == row["roll_mean_deg"]


def test_recordings_in_memory_come_from_an_iterator(folder, dataset, tmp_path):
    seen, given = [], iter(in_memory(folder, "r1.parquet", "r2.parquet"))
    done = plumbob.batch(given, tmp_path / "out", progress=lambda *now: seen.append(now), jobs=1, **SETTINGS)
    assert seen == [(1, None), (2, None)] and done.counts["done"] == 2
    assert parts(tmp_path / "out").items() <= parts(dataset[1]).items()


def test_wrong_options_show_before_any_work(folder, tmp_path):
    for wrong in (
        {"filter": "kalman"}, {"params": {"kq": 1.0}, **SETTINGS}, {"burst": "-1 s"}, {"jobs": 0}, {"place": "north"},
        {"jobs": 2, "cluster": "tcp://127.0.0.1:1"}, {"profile": "none.toml"},
    ):  # fmt: skip
        with pytest.raises(DecodeError if "profile" in wrong else ParameterError):
            plumbob.batch(folder, tmp_path / "out", **wrong)
    assert not (tmp_path / "out").exists()
    with pytest.raises(ParameterError, match="nothing matches"):
        plumbob.batch(folder / "*.mcap", tmp_path / "out", **SETTINGS)


def test_cards_go_by_device(tmp_path):
    given, cards = [], []
    for seed in (1, 2):
        raw, poses = (
            plumbob.simulate(scenario, seed=seed, **SIM | {"unit": "random"}, **how).imu
            for scenario, how in (("buoy", {"duration": 6.0}), ("poses", {}))
        )
        given.append(raw.corrected(meta=replace(raw.meta, device=f"unit {seed}")))
        cards.append(replace(plumbob.calibrate(poses, "accel").card, device=f"unit {seed}"))
        cards[-1].save(tmp_path / f"{seed}.json")
    third = given[0].corrected(meta=replace(given[0].meta, device="unit 3"))
    named = [plumbob.Recording(imu=imu, name=imu.meta.device) for imu in (*given, third)]
    done = plumbob.batch(named, tmp_path / "out", calibration=tmp_path, jobs=1, **SETTINGS)
    assert verdicts(done.rows()) == {"unit 1": "done", "unit 2": "done", "unit 3": "refused"}
    for imu, card in zip(given, cards, strict=True):
        track = plumbob.estimate(imu, "mahony", calibration=card).track
        part = tmp_path / f"out/attitude/recording={imu.meta.device}/part.parquet"
        assert plumbob.read(part).track.q_nb.tobytes() == track.q_nb.tobytes()
    with pytest.raises(ParameterError, match="two calibration cards"):
        load_cards([cards[0], cards[0]])
    with pytest.raises(CalibrationError, match="unit 9"):
        BatchSettings({}, load_cards(tmp_path)).card_for("unit 9")
    assert BatchSettings({}, load_cards(cards[0])).card_for("unit 9") is cards[0]


def test_behind_urls(folder, dataset, tmp_path, memory):
    upload(memory, folder, "/sea", "cut.parquet", *(f"r{seed}.parquet" for seed in (1, 2, 4, 5)))
    done = plumbob.batch("memory://sea", tmp_path / "urls", jobs=2, **SETTINGS)
    assert (done.counts["done"], done.counts["damaged"]) == (4, 1)
    assert parts(tmp_path / "urls").items() <= parts(dataset[1]).items()
    assert plumbob.batch("memory://sea/r*.parquet", tmp_path / "urls", **SETTINGS).skipped == 4
    with pytest.raises(ParameterError, match="is a URL, but a dataset is a folder"):
        plumbob.batch("memory://sea", "memory://dataset", **SETTINGS)
    with pytest.raises(DecodeError, match="more than 100 bytes"), fetched("memory://sea/r1.parquet", 100):
        pass
    plumbob.write(tmp_path / "r.csv", made(1).imu)
    upload(memory, tmp_path, "/tables", "r.csv", "r.profile.toml")  # a table with its profile
    assert plumbob.batch("memory://tables", tmp_path / "out", **SETTINGS).counts["done"] == 1


def test_what_does_not_answer_is_one_error_or_one_row(folder, tmp_path, memory, monkeypatch):
    upload(memory, folder, "/lake", "r1.parquet", "r2.parquet")
    whole = type(memory).open

    def cut(self, path, *how, **more):
        if "r1" in path:
            raise RuntimeError("no route")  # as botocore, whose errors are not of the system
        return whole(self, path, *how, **more)

    with monkeypatch.context() as patch:
        patch.setattr(type(memory), "open", cut)
        rows = plumbob.batch("memory://lake", tmp_path / "out", jobs=2, **SETTINGS).rows()
    assert verdicts(rows) == {"r1.parquet": "failed", "r2.parquet": "done"}
    assert rows[0]["reason"].startswith("memory://lake/r1.parquet cannot be reached: no route. Check")
    assert plumbob.batch("memory://lake", tmp_path / "out", jobs=1, **SETTINGS).counts["done"] == 2
    with monkeypatch.context() as patch:
        patch.setattr(type(memory), "isfile", lambda *_, **__: 1 // 0)
        with pytest.raises(LineError, match="memory://lake cannot be reached"):
            plumbob.batch("memory://lake", tmp_path / "new", **SETTINGS)


def test_names(folder):
    said = []
    found = {item.name: item for item in batch_items(folder, said.append)}
    assert len(found) == GOOD + 3 and found["deep/r0.parquet"].key == "deep%2Fr0.parquet"
    assert said == [f"{folder}: left out, no recordings by their suffix or content: notes.doc"]
    assert [item.name for item in batch_items(f"{folder}/**/r0.parquet", said.append)] == ["deep/r0.parquet"]
    assert [item.name for item in batch_items(folder / "r1.parquet", said.append)] == ["r1.parquet"]
    with pytest.raises(ParameterError, match="two recordings are called r1"):
        list(batch_items([folder / "r1.parquet", folder / "r1.parquet"], said.append))
    keys = {Item(f"{'é' * 100}{end}", "").key for end in "ab"}
    assert len(keys) == 2 and max(map(len, keys)) < 200
    assert "/" not in Item("../../etc/x", "").key and Item("..", "").key == ".."


def test_the_verb_is_the_function(folder, dataset, tmp_path):
    done = call("batch", folder, "--filter", "mahony", "--jobs", "2", "--out", tmp_path / "out", "--json")
    assert done.returncode == 3, done.stderr
    said = json.loads(done.stdout)
    assert (said["verdicts"], [one["recording"] for one in said["not_done"]]) == (dataset[0].counts, sorted(BAD))
    assert "note: cut.parquet: damaged: " in done.stderr
    assert parts(tmp_path / "out") == parts(dataset[1])
    good = call("batch", f"{folder}/r*.parquet", "--filter", "mahony", "--out", tmp_path / "good")
    assert good.returncode == 0 and "done         6" in good.stdout


def test_a_defect_fails_its_job_alone_and_is_tried_again(folder, tmp_path, monkeypatch):
    files = [folder / "r1.parquet", folder / "r2.parquet"]
    with monkeypatch.context() as patch:
        patch.setattr("plumbob.fleet.job.opened", lambda *_, **__: [].pop())
        assert plumbob.batch(files, tmp_path / "out", jobs=1, **SETTINGS).counts["failed"] == 2
    assert plumbob.batch(files, tmp_path / "out", jobs=1, **SETTINGS).counts["done"] == 2


@pytest.mark.long("starts a scheduler and two workers in processes of their own")
def test_a_cluster_that_loses_a_worker_gives_the_same_bits(folder, dataset, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        pid = cluster.workers[0].process.pid
        how = {"cluster": cluster.scheduler_address, "progress": lambda done, _: done == 2 and os.kill(pid, 9)}
        assert plumbob.batch(folder, tmp_path / "out", **how, **SETTINGS).counts == dataset[0].counts
    assert not lives(pid) and parts(tmp_path / "out") == parts(dataset[1])


def test_what_is_no_recording_is_a_row_or_left_out(tmp_path):
    """Pipes and devices are never read; a file of a recording's suffix is a row, whatever is in it."""
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / "in" / "pipe.csv")
    (tmp_path / "in" / "endless.parquet").symlink_to("/dev/zero")
    (tmp_path / "in" / "empty.zip").write_bytes(b"")
    (tmp_path / "in" / "noise.ulg").write_bytes(np.random.default_rng(1).bytes(500))
    (tmp_path / "in" / "firmware.bin").write_bytes(b"no log of a flight")
    (tmp_path / "in" / "plain.csv").write_text("t,gx,gy,gz\n0,1,2,3\n")  # it needs a profile, and nothing is damaged
    rows = plumbob.batch(tmp_path / "in", tmp_path / "out", filter="mekf", note=(notes := []).append, jobs=1).rows()
    refused = dict.fromkeys(("noise.ulg", "plain.csv"), "refused")
    assert verdicts(rows) == refused | dict.fromkeys(("pipe.csv", "endless.parquet", "empty.zip"), "damaged")
    assert sum("is not a regular file" in row["reason"] for row in rows) == 2
    assert [note.rpartition(": ")[2] for note in notes if "left out" in note] == ["firmware.bin"]
