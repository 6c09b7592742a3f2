"""plumbob calibrate table: real processes, real files."""

import json

import pytest

from plumbob.data.cards import CalibrationCard
from tests.helpers.commandline import ok, plumbob, refused

RATES = "50, 100, 200 deg/s"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "session.parquet"
    sim = ("--frame", "NED", "--sensors", "mpu6000", "--unit", "random", "--seed", 3, "--set", "hold=4s")
    ok("sim", "ratetable", *sim, "--out", path)
    return path


def test_from_the_simulated_session_to_a_card_that_run_takes(session, tmp_path):
    card = tmp_path / "card.json"
    text = ok("calibrate", "table", session, "--rates", RATES, "--latitude", "0 deg", "--out", card).stdout
    assert "card" in text and "Earth" not in text
    found = CalibrationCard.load(card)
    assert found.gyr.method == "rate table, 42 plateaus, 21 parameters"
    assert found.gyr.quality.grade in {"good", "fair"}
    ok("run", session, "--filter", "integrate", "--calibration", card, "--out", tmp_path / "track.parquet")


def test_the_model_can_be_chosen(session):
    told = json.loads(ok("calibrate", "table", session, "--rates", RATES, "--model", "12", "--json").stdout)
    assert told["card"]["method"].endswith("12 parameters")


def test_a_refusal_writes_no_card(session, tmp_path):
    card = tmp_path / "card.json"
    told = plumbob("calibrate", "table", session, "--rates", "2, 3 rad/s", "--out", card, "--json")
    assert told.returncode == 1 and not card.exists()
    assert json.loads(told.stdout)["refused"][0]["kind"] == "no-motion"


def test_rates_without_a_unit_and_a_bad_plan_are_refused(session, tmp_path):
    assert "needs a unit of rate" in refused("calibrate", "table", session, "--rates", "50,100")
    plan = tmp_path / "plan.csv"
    plan.write_text("from_s,to_s\n1,2\n")
    assert "line 1: a plan has the columns" in refused("calibrate", "table", session, "--plan", plan)
