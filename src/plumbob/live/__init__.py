"""Sessions: a live stream described in TOML, from bytes to an attitude, and its replay from the recorded bytes.

`session` is the description, `stream` what it describes: decode, stamp, calibrate, estimate, hand to the sinks. A
replay feeds it the recorded bytes and gives the same bits.
"""
