"""Acquisition: serial lines, sockets, Linux IIO and SPI, each behind one `Source`, with honest time.

A source is made, opened and read; once it is open nothing that happens to the line raises::

    with SerialSource("/dev/ttyUSB0", 115200) as source:
        while running:
            for item in source.read(0.1):  # Received or Event, oldest first
                ...

A source belongs to one thread at a time.
"""
