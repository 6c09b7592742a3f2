"""Readers of other programs' files: a module for each kind, which all have two functions.

``accepts(path)``
    Whether a file or a folder is of the kind, by its whole signature: first bytes, names and units, structure.
``read(path)``, or ``read(path, unit)`` where a file may hold several units
    The recording. It is only called with what the module accepts, and the path is put before its errors:
    `DecodeError` where the content is damaged or lacks what a recording needs, `ParameterError` where there is no such
    unit, `ClockError` where stamps are not a clock's, `UnitError` where numbers cannot be in their unit.

What a file holds becomes a `plumbob.files.foreign.logged.SensorLog`, which joins, checks and converts it.
"""
