"""One tree of errors. Each message says the rule, what was expected, what came, where, and what to do."""

from collections.abc import Iterable

from plumbob.core.text import closest


class PlumbobError(Exception):
    """Base of every error that Plumbob raises on purpose; the command line prints it as one line and exits 1."""


class UnitError(PlumbobError, ValueError):
    """A quantity has no unit, an unknown unit, or values that its stated unit makes impossible."""


class FrameError(PlumbobError, ValueError):
    """A navigation frame, body axis or heading reference is missing, unknown or does not match."""


class ShapeError(PlumbobError, ValueError):
    """An array has the wrong shape, type or length, or holds nothing usable."""


class ClockError(PlumbobError, ValueError):
    """Time stamps are not finite, not increasing or do not overlap."""


class DecodeError(PlumbobError, ValueError):
    """A file or byte stream is not what it claims to be, or is damaged."""


class UnknownFormatError(DecodeError):
    """A file or folder of no known format, or one that needs a profile: nothing says that it is damaged."""


class ParameterError(PlumbobError, ValueError):
    """A parameter is unknown or outside its range."""


class CalibrationError(PlumbobError, ValueError):
    """A calibration or noise card does not belong to the data that it is asked to serve."""


class LineError(PlumbobError, OSError):
    """A line, port or device cannot be opened: absent, busy, forbidden, or not what was asked for."""


class MissingExtraError(PlumbobError, ImportError):
    """An optional dependency is not installed; the message says which extra brings it."""


class PlumbobWarning(UserWarning):
    """What a caller should look at, though the work goes on: data that look as if a unit or a sign were wrong."""


def one_line(error: BaseException) -> str:
    """Text of an error without line breaks."""
    return " ".join(str(error).split())


def excerpt(text: str, size: int = 60) -> str:
    """Text found in a file, quoted, without control characters and cut to `size` characters."""
    return repr(text if len(text) <= size else text[:size] + "…")


def unknown_name(
    what: str,
    name: object,
    there: Iterable[str],
    *,
    of: str = "",
    hint: str = "",
    error: type[PlumbobError] = ParameterError,
) -> PlumbobError:
    """Error for a name that is not among those that there are, of something; with the nearest, or another hint."""
    names, quoted = list(there), excerpt(name) if isinstance(name, str) else repr(name)
    lacking = f"{of} has no {what}" if of else f"there is no {what}"
    return error(f"{lacking} {quoted}; known: {', '.join(names) or 'none'}.{hint or closest(name, names)}")
