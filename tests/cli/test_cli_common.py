"""What verbs share: options and parameters as they are written, and which file is which."""

import argparse
from pathlib import Path

import numpy as np
import pytest

from plumbob import Filter, Frame
from plumbob.cli import common
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError
from plumbob.core.files import write_text
from plumbob.data.cards import NoiseCard, TriadNoise
from tests.helpers.commandline import plumbob


def options(*items):
    return common.named_values(items)


def params_of(names, params):
    return {stage.filter: stage.params for stage in common.stages(names, params)}


def test_options_and_parameters_are_read_as_they_are_written():
    assert options() == {}
    assert options("gyr_range=500 deg/s", " acc_range = 4 g ") == {"gyr_range": "500 deg/s", "acc_range": "4 g"}
    assert options("a=b=c") == {"a": "b=c"}
    assert params_of("mahony", "kp=0.7, gate = 0.08 g") == {"mahony": {"kp": "0.7", "gate": "0.08 g"}}
    assert params_of("mahony", "mahony.kp=0.7") == {"mahony": {"kp": "0.7"}}
    two = params_of("mahony, vqf", "vqf.tau_acc=2s,mahony.kp=0.7")
    assert two == {"mahony": {"kp": "0.7"}, "vqf": {"tau_acc": "2s"}}
    assert params_of("vqf", None) == {"vqf": {}}


@pytest.fixture
def toml(tmp_path):
    """Stages by a file of parameters."""

    def call(text, names="mahony"):
        (tmp_path / "p.toml").write_text(text, encoding="utf-8")
        return common.stages(names, str(tmp_path / "p.toml"))

    return call


def test_a_file_holds_plain_keys_or_a_table_for_each_filter(toml):
    """Where a quantity has one unit a number does; 0.08 g is 0.08 × 9.80665 m/s²."""
    for text in (
        'kp = 1\ngate = "0.08 g"\nquick_start = true\n',
        '[mahony]\nkp = 1\ngate = "0.08 g"\nquick_start = true\n',
    ):
        (stage,) = toml(text)
        params = Filter("mahony", frame=Frame.ENU, params=stage.params).params
        assert (params.kp, params.quick_start) == (1.0, True)
        assert params.gate == pytest.approx(0.784532, rel=1e-12)
    one, two = toml("[mahony]\nkp = 0.7\n[vqf]\ntau_acc = 2.5\n", "mahony,vqf")
    assert Filter("mahony", frame=Frame.ENU, params=one.params).params.kp == 0.7
    assert Filter("vqf", frame=Frame.ENU, params=two.params).params.tau_acc == 2.5


def stages(params, names="mahony"):
    return lambda: common.stages(names, params)


REFUSED = [
    (lambda: options("a=1", "a=1"), ParameterError, "--option a is given twice"),
    (lambda: options("a=1", "b=2", " a =3"), ParameterError, "--option a is given twice"),
    *((lambda word=word: options(word), ParameterError, "NAME=VALUE") for word in ("a", "a=", "=1", " =1")),
    (stages("kp=1,kp=1"), ParameterError, "'kp' is given twice"),
    (stages("kp=1,mahony.kp=2"), ParameterError, "'mahony.kp' is given twice"),
    (stages("kp=1", "mahony,vqf"), ParameterError, "could belong to any of mahony, vqf; write mahony.kp"),
    (stages("vqf.tau_acc=2s"), ParameterError, "names filter 'vqf', which does not run; these do: mahony"),
    *((stages(params), ParameterError, "name=value") for params in ("kp", "kp=", "=1")),
    (stages(None, " , "), ParameterError, "no filter is named"),
    (lambda: common.print_json({"x": float("nan")}), ValueError, "not JSON compliant"),
]


NO_TOML = (
    "kp = ",
    "[mahony]\nkp = 1\n[mahony]\nkp = 2\n",
    "kp = 1\nkp = 2\n",
    f"kp = 0x{'f' * 5000}",
    "a." * 5000 + "b=1",
)


def test_what_is_not_whole_or_fits_nothing_is_refused(toml):
    for call, error, says in REFUSED:
        with pytest.raises(error, match=says):
            call()
    for text in NO_TOML:
        with pytest.raises(ParameterError, match=r"p\.toml is not valid TOML"):
            toml(text)
    for number in ("0.08", "1", "1e-2"):  # a gate is usual in g and in m/s²: nobody knows which is meant
        (stage,) = toml(f"gate = {number}\n")
        with pytest.raises(PlumbobError, match="needs a unit of acceleration"):
            Filter("mahony", frame=Frame.ENU, params=stage.params)


def test_an_input_is_kept_by_whatever_name_it_is_reached(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("in.csv", "other.csv"):
        Path(name).write_text(name, encoding="utf-8")
    Path("soft.csv").symlink_to("in.csv")
    Path("hard.csv").hardlink_to("in.csv")
    ours = argparse.Namespace(force=True)  # which is of no use here
    for out in ("in.csv", "./in.csv", "soft.csv", "hard.csv", str(tmp_path / "in.csv")):
        with pytest.raises(ParameterError, match="is an input"):
            common.check_outputs(ours, Path(out), inputs=(None, Path("other.csv"), Path("in.csv")))
    for out in (None, Path("new.csv"), Path("other.csv")):
        common.check_outputs(ours, out, inputs=(Path("in.csv"), None))
        assert list(ours.outputs) == ([] if out is None else [out])
    with pytest.raises(ParameterError, match="is an input"):  # neither is there yet
        common.check_outputs(ours, Path("new.csv"), inputs=(Path("made/../new.csv"),))
    Path("in.profile.toml").touch()
    with pytest.raises(ParameterError, match=r"in\.profile\.toml is an input"):  # it says what in.csv means
        common.check_outputs(ours, Path("in.profile.toml"), inputs=(Path("in.csv"),))
    with pytest.raises(ParameterError, match="named for two outputs"):
        common.check_outputs(ours, Path("new.csv"), Path("./new.csv"))


def test_links_that_lead_in_a_circle_are_no_files(tmp_path):
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.symlink_to(other)
    other.symlink_to(one)
    common.check_outputs(argparse.Namespace(force=True), tmp_path / "new.csv", inputs=(one,))  # reading will refuse it
    for force in (True, False):
        with pytest.raises(DecodeError, match="a link that points to itself"):
            common.check_outputs(argparse.Namespace(force=force), one)
    read = plumbob("convert", one, tmp_path / "new.csv")
    assert (read.returncode, read.stderr.count("\n")) == (1, 1)
    assert "one.csv does not exist" in read.stderr
    compared = plumbob("eval", one, other)
    assert (compared.returncode, compared.stderr.count("\n")) == (1, 1)


def test_what_is_not_written_is_known_at_the_end(tmp_path):
    """By the file itself: one that is replaced, and one that is there as it was."""
    kept, replaced, absent, made = (tmp_path / name for name in ("kept", "replaced", "absent", "made"))
    for path in (kept, replaced):
        path.write_text("before")
    args = argparse.Namespace(force=True)
    common.check_outputs(args, kept, replaced, absent, made)
    for path in (replaced, made):
        write_text(path, "after", overwrite=True)
    assert common.unwritten(args) == [kept, absent]


def test_a_noise_card_is_told_to_the_filters_that_take_none(capsys, tmp_path):
    """mekf claims a covariance by the noise of the unit; mahony has gains only."""
    NoiseCard("unit 7", "rest", gyr=TriadNoise(*np.full((3, 3), 1e-4))).save(tmp_path / "n.json")
    given = common.given_noise(common.stages("mahony,mekf", None), tmp_path / "n.json")
    assert [stage.noise is None for stage in given] == [True, False]
    assert capsys.readouterr().err == "note: the noise card is for mekf; mahony can take nothing from it\n"
    common.tell_noise(common.stages("mekf", None))
    assert capsys.readouterr().err == ""
