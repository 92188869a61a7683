"""What a server prints: read as it comes, so that it never waits for us; only the end is kept."""

import os
import select
from threading import Event, Lock, Thread

KEPT_BYTES = 65_536
LOOK_MS = 50


class Printed:
    """The end of what is written into a pipe.

    Attributes:
        write_end: File descriptor for whoever prints; ours is to be closed once it has it.
    """

    def __init__(self) -> None:
        self._read_end, self.write_end = os.pipe()
        self._kept = b""
        self._lock = Lock()
        self._stop = Event()
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def last_words(self, most: int) -> str:
        """Its end, of what has come so far."""
        with self._lock:
            return self._kept[-most:].decode(errors="replace").strip()

    def drained(self, timeout_s: float) -> None:
        """Wait until nobody holds the other end any more, or for so long."""
        self._reader.join(timeout_s)

    def close(self) -> None:
        """Read no more, even if somebody still holds the other end."""
        self._stop.set()
        self._reader.join()

    def _read(self) -> None:
        look = select.poll()
        look.register(self._read_end, select.POLLIN)
        try:
            while not self._stop.is_set():
                if not look.poll(LOOK_MS):
                    continue
                said = os.read(self._read_end, KEPT_BYTES)
                if not said:
                    return
                with self._lock:
                    self._kept = (self._kept + said)[-KEPT_BYTES:]
        finally:
            os.close(self._read_end)
