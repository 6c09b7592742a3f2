"""Acquisition: serial lines, sockets, Linux IIO and SPI, each behind one `Source`, with honest time."""
