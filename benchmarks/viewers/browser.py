"""Chromium without a window, driven over its debugging port: a page is opened, asked and pictured.

WebGL is drawn by the processor, so that a machine without a graphics card shows what others do.
"""

import base64
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from websockets.sync.client import ClientConnection, connect

PATIENCE_S = 180.0
NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--mute-audio",
    "--disable-background-networking", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--remote-debugging-port=0",
)  # fmt: skip


class Page:
    """One open page."""

    def __init__(self, wire: ClientConnection) -> None:
        self._wire = wire
        self._asked = 0

    def ask(self, method: str, **parameters: object) -> dict[str, Any]:
        """Send one command and wait for its answer.

        Raises:
            RuntimeError: The browser refuses it.
        """
        self._asked += 1
        self._wire.send(json.dumps({"id": self._asked, "method": method, "params": parameters}))
        while True:
            said = json.loads(self._wire.recv(timeout=PATIENCE_S))
            if said.get("id") == self._asked:
                if "error" in said:
                    raise RuntimeError(f"{method}: {said['error']}")
                result: dict[str, Any] = said["result"]
                return result

    def value(self, expression: str) -> Any:
        """What an expression is in the page."""
        said = self.ask("Runtime.evaluate", expression=expression, returnByValue=True)
        return said["result"].get("value")

    def wait(self, expression: str) -> None:
        """Wait until an expression is true in the page.

        Raises:
            TimeoutError: It does not become true.
        """
        self._until(lambda: bool(self.value(expression)), expression)

    def picture(self, out: Path) -> None:
        """Write what is shown as PNG."""
        said = self.ask("Page.captureScreenshot", format="png")
        out.write_bytes(base64.b64decode(said["data"]))

    def _until(self, true: Callable[[], bool], what: str) -> None:
        last = time.monotonic() + PATIENCE_S
        while not true():
            if time.monotonic() > last:
                raise TimeoutError(f"not so after {PATIENCE_S:.0f} s: {what}")
            time.sleep(0.2)


@contextmanager
def opened(address: str, *, width_px: int = 1600, height_px: int = 1000) -> Iterator[Page]:
    """A page of the browser, which ends with it.

    Args:
        address: Of the page.
        width_px: Of the window.
        height_px: Likewise.

    Raises:
        RuntimeError: No Chromium is installed, or it does not start.
    """
    command = next(filter(None, map(shutil.which, NAMES)), None)
    if command is None:
        raise RuntimeError(f"none of {', '.join(NAMES)} is installed")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        size = f"--window-size={width_px},{height_px}"
        process = subprocess.Popen(
            [command, *FLAGS, size, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            port = _port(Path(profile), process)
            with urlopen(Request(f"http://127.0.0.1:{port}/json/new", method="PUT")) as answer:
                wire = json.load(answer)["webSocketDebuggerUrl"]
            with connect(wire, max_size=None) as connection:
                page = Page(connection)
                page.ask("Page.enable")
                page.ask(
                    "Emulation.setDeviceMetricsOverride",
                    width=width_px, height=height_px, deviceScaleFactor=1, mobile=False,
                )  # fmt: skip
                page.ask("Page.navigate", url=address)
                yield page
        finally:
            process.terminate()
            process.wait(timeout=PATIENCE_S)


def _port(profile: Path, process: "subprocess.Popen[bytes]") -> int:
    said, last = profile / "DevToolsActivePort", time.monotonic() + PATIENCE_S
    while not (said.is_file() and "\n" in said.read_text()):
        if process.poll() is not None or time.monotonic() > last:
            raise RuntimeError("the browser does not start")
        time.sleep(0.1)
    return int(said.read_text().split()[0])
