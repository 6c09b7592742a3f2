"""plumbob calibrate table: real files."""

from plumbob.data.cards import CalibrationCard
from tests.helpers.commandline import answer, typed

RATES = "--rates '50, 100, 200 deg/s'"


def test_from_the_simulated_session_to_a_card_that_run_takes_or_a_refusal(tmp_path):
    unit = "--sensors mpu6000 --unit random --seed 3"
    typed(f"sim ratetable --frame NED {unit} --set hold=4s --out session.parquet", cwd=tmp_path)
    card = tmp_path / "card.json"
    typed(f"calibrate table session.parquet {RATES} --latitude '0 deg' --out {card}", cwd=tmp_path)
    gyr = CalibrationCard.load(card).gyr
    assert gyr.method == "rate table, 42 plateaus, 21 parameters"
    assert gyr.quality.grade in {"good", "fair"}
    typed(f"run session.parquet --filter integrate --calibration {card}", cwd=tmp_path)
    chosen = answer(f"calibrate table session.parquet {RATES} --model 12", cwd=tmp_path)
    assert chosen["card"]["method"].endswith("12 parameters")
    card = tmp_path / "none.json"
    refusal = answer(f"calibrate table session.parquet --rates '2, 3 rad/s' --out {card}", cwd=tmp_path, code=1)
    assert (refusal["refused"][0]["kind"], card.exists()) == ("no-motion", False)
