"""What a file says cannot steer the terminal that shows it, nor leave the comment that quotes it."""

import json
from dataclasses import replace

import numpy as np

from plumbob import AttitudeTrack, Frame, ImuData, ImuMeta, North, Recording, convert, files, find_format
from plumbob.cli.main import main
from plumbob.core.text import visible
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.files.mcap import Recorder
from plumbob.protocols.c_header import c_header

STEER = "unit\x1b]0;owned\x07\x1b[2J\x9b31m\u202edoog\nverdict      whole"
SHOWN = "unit\\x1b]0;owned\\x07\\x1b[2J\\x9b31m\\u202edoog\\nverdict      whole"


def test_every_control_character_is_an_escape_and_a_title_does_not_end_the_comment_of_a_header():
    assert visible(STEER) == SHOWN
    controls = [chr(i) for i in range(0x20)] + [chr(i) for i in range(0x7F, 0xA0)]  # C0, DEL and C1 of Unicode
    assert all(visible(c).isascii() and visible(c).isprintable() for c in controls)
    assert visible("a\tb\nµ °", keep="\n\t") == "a\tb\nµ °"
    form = replace(find_format("fin"), title="fin */ int owned; /* \n#include <evil.h>")
    text = c_header(form)
    assert text.startswith("/* fin * / int owned; / * \\n#include <evil.h>\n")
    assert text.count("/*") == text.count("*/") == c_header(find_format("fin")).count("/*")


def test_info_and_files_for_other_programs_hold_no_command_for_a_terminal(tmp_path, capsys):
    t = np.arange(100) * 0.01
    imu = ImuData(t=t, gyr=np.random.default_rng(0).normal(size=(100, 3)), meta=ImuMeta(device=STEER))
    files.write(tmp_path / "a.parquet", Recording(imu=imu, name="a", notes=(STEER,)))
    assert main(["info", str(tmp_path / "a.parquet")]) == 0
    shown = capsys.readouterr()
    assert f"device       {SHOWN}, body axes" in shown.out
    assert "note         unit\\x1b]0;owned" in shown.out
    assert (shown.out + shown.err).replace("\n", "").isprintable()
    assert main(["info", str(tmp_path / "a.parquet"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sensors"]["device"] == STEER
    # Head of CSV, TUM and text: what somebody looks at with `cat`.
    track = AttitudeTrack(t=t, q_nb=np.tile([1.0, 0, 0, 0], (100, 1)), frame=Frame.ENU, north=North.FREE, source=STEER)
    whole = Recording(imu=imu, track=track, name=STEER, notes=(STEER,))
    for suffix in (".csv", ".tum", ".txt"):
        convert(whole, tmp_path / f"a{suffix}")
        text = (tmp_path / f"a{suffix}").read_text(encoding="utf-8")
        assert text.replace("\n", "").replace("\t", "").isprintable()
    assert files.read(tmp_path / "a.csv").imu.meta.device == STEER  # its profile has it as it was


def test_topics_cards_and_errors_are_shown_so_too(tmp_path, capsys, monkeypatch):
    """Wherever a verb prints: output and messages go through one door."""
    monkeypatch.chdir(tmp_path)
    recorder = Recorder(tmp_path / "a.mcap", epoch_offset_ns=0)
    number = recorder.channel(STEER, "json")
    with recorder:
        recorder.write(number, 1, b"{}")
    noise = TriadNoise([1e-4] * 3, [1e-5] * 3, [0.0] * 3)
    NoiseCard("unit\x1b[2J", "data\x1b[1m sheet", gyr=noise).save("card.json")
    assert [main(["verify", "a.mcap"]), main(["info", "card.json"])] == [0, 0]
    text = (tmp_path / "card.json").read_text().replace("format_version", "\\u001b[2J")
    (tmp_path / "card.json").write_text(text)
    assert main(["run", "x.parquet", "--noise", "card.json", "--filter", "mekf\x1b[2J"]) == 1
    shown = capsys.readouterr()
    assert f"rows         {SHOWN}: 1" in shown.out
    assert [("\\x1b[2J" in text, "\x1b" in text) for text in (shown.out, shown.err)] == [(True, False)] * 2
