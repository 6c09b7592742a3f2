"""The benchmark of decoders: tables, JSON, formats by name and file, and refusals."""

import json

from benchmarks.harness.__main__ import main
from benchmarks.harness.decoder_streams import HARMS, USER_FRAME
from tests.helpers.commandline import call

SMALL = ("--frames", "200", "--noise", "10000", "--fuzz", "5000")


def test_it_prints_a_table_or_json_of_formats_by_name_and_file(tmp_path):
    (tmp_path / "mine.toml").write_text(USER_FRAME)
    lines = call("decoders", "--formats", "rion,mpu6000", *SMALL, main=main).stdout.splitlines()
    rows = [line for line in lines if line.startswith("mpu6000")]
    assert [row.count("–") for row in rows] == [len(HARMS) - 1, 3]
    done = call("decoders", "--formats", tmp_path / "mine.toml", *SMALL, "--json", main=main)
    result = json.loads(done.stdout)
    mine = result["formats"]["user_crc16"]
    assert result["met"] and set(mine["harms"]) == set(HARMS) and mine["noise"]["size"] == 10_000
    assert mine["fuzzed"]["pending"] <= mine["fuzzed"]["bound"]
