"""Every catalogued format against the battery, and the same bits as plain Python."""

from plumbob.protocols.format_toml import device_names
from tests.helpers import in_the_other_mode
from tests.helpers.decoder_battery import DecoderBattery, digest


class TestEveryFormat(DecoderBattery):
    pass


def test_compiled_and_plain_python_give_the_same_bits():
    code = "from tests.helpers.decoder_battery import device_names, digest; "
    code += "given = {name: digest(name) for name in device_names()}"
    assert in_the_other_mode(code, warnings="default") == {name: digest(name) for name in device_names()}
