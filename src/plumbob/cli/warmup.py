"""plumbob warmup: compile before it matters."""

import argparse

from plumbob.cli import common

SESSION = """\
kind = "plumbob session"
version = 1
[format]
name = "mpu6000"
"""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "warmup",
        help="compile all filters, decoders and the noise analysis for this processor now",
        description="Compile all filters, what takes bytes apart, the noise analysis and the fits of calibrations for "
        "this processor now, so that no first run or live start waits for it.",
        epilog=common.more("plumbob warmup", "start.md"),
    )
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.calibration.guide import guides
    from plumbob.core import _jit
    from plumbob.core.errors import PlumbobError
    from plumbob.filters import Filter, filter_names
    from plumbob.filters.channel import RateFilter, channel_names
    from plumbob.filters.smoother import Smoother
    from plumbob.noise import allan
    from plumbob.rotations import Frame
    from plumbob.session.session_toml import parse_session
    from plumbob.session.stream import Stream

    _jit.compiling("everything")  # which the user has asked for, and need not be told
    names, channels = filter_names(), channel_names()
    with common.progress("compiling", len(names) + len(channels) + 4) as advance:
        for name in names:
            Filter(name, frame=Frame.ENU).warm_up()
            advance(1)
        for name in channels:
            RateFilter(name).warm_up()
            advance(1)
        Stream(parse_session(SESSION, str, name="warmup")).warm_up()
        advance(1)
        for part in (Smoother(frame=Frame.ENU), allan, guides):
            part.warm_up()
            advance(1)
    if (why := _jit.why_no_cache()) is not None:
        raise PlumbobError(f"{why}, so compiled kernels are lost when this ends.")
    many = f"{len(names)} filters, the smoother, {len(channels)} filters of a rate channel"
    ready = f"{many}, the decoder, the noise analysis and the fits are ready"
    print(f"{ready}; compiled kernels are kept in {_jit.cache_folder()}")
    return 0
