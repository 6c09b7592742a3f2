"""Process that stands in for the server: ``deaf`` never reads, ``reader`` reads, and writes what it got."""

import json
import socket
import sys
import time

from plumbob.viewer.pipe import MessageUnpacker, PipeMessage, packed


def main(number, kind, log):
    end = socket.socket(fileno=int(number))
    end.sendall(packed(PipeMessage("ready", {"port": 4242})))
    if kind == "deaf":
        time.sleep(60)
        return
    unpacker = MessageUnpacker()
    with open(log, "a", encoding="utf-8") as file:  # noqa: PTH123
        while data := end.recv(1 << 16):
            for message in unpacker.feed(data):
                rows = {name: len(values) for name, values in message.arrays.items()}
                file.write(json.dumps([message.kind, rows, message.content.get("card")]) + "\n")
                file.flush()
                if message.kind == "end":
                    return


if __name__ == "__main__":
    main(*sys.argv[1:])
