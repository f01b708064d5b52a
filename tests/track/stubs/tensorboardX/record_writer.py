"""Writes records to a file, a full disk or a server that is gone; or never returns."""

import os
import socket
import time
from pathlib import Path


class RecordWriter:
    def __init__(self, path):
        how = os.environ["HOW_TRACKED"]
        if how == "a dead server":
            socket.create_connection(("127.0.0.1", 9), timeout=5)
        self._waits = how == "a server that hangs"
        place = Path("/dev/full" if how == "a full disk" else path)
        self._file = place.open("wb", buffering=0)

    def write(self, data):
        while self._waits:
            time.sleep(0.1)
        self._file.write(data + b"\n")

    def flush(self):
        pass

    def close(self):
        self._file.close()
