"""A page in headless Chromium, controlled through the Chrome DevTools protocol."""

import base64
import io
import json
import shutil
import subprocess
import tempfile
import time
from types import TracebackType
from typing import Any, Self

import numpy as np
import pytest

from taxel.types import ByteArray

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
START_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 120.0


def find_chromium_program() -> str:
    """Return the path of the browser. Skip the test if no browser, or no package `websockets`, is installed."""
    path = next((path for name in PROGRAMS if (path := shutil.which(name))), None)
    if path is None:
        pytest.skip("no chromium: 'apt-get install chromium' opens the pages for this test")
    pytest.importorskip("websockets", reason="no websockets: pip install 'taxel[test]' connects to chromium")
    return path


class Page:
    """A page at `url` (http:// or file://) in its own browser. A context manager.

    The attribute `problems` lists the errors of the console and the uncaught exceptions so far.
    """

    def __init__(self, url: str, width: int = 1400, height: int = 900) -> None:
        program = find_chromium_program()
        self.problems: list[str] = []
        self._folder = tempfile.TemporaryDirectory(prefix="taxel-chromium-", ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [program, "--headless", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars",
             "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", "--disable-sync",
             "--disable-background-timer-throttling", "--disable-renderer-backgrounding",
             f"--window-size={width},{height}", f"--user-data-dir={self._folder.name}", "--remote-debugging-port=0",
             "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._number = 0
        try:
            self._connect()
            for domain in ("Runtime", "Log", "Page"):
                self.send_command(f"{domain}.enable")
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            self.send_command("Emulation.setDeviceMetricsOverride", **size)
            self.send_command("Page.navigate", url=url)
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        """Wait until the browser has a page, and connect to the DevTools socket of this page."""
        import urllib.request

        from websockets.sync.client import connect

        assert self._process.stderr is not None
        address = ""
        for line in self._process.stderr:  # ends when the browser ends
            if "DevTools listening on " in line:
                address = line.split("DevTools listening on ")[1].strip()
                break
        assert address, "chromium ended before it listened"
        port = address.split("/")[2]
        deadline = time.monotonic() + START_TIMEOUT_S
        pages: list[dict[str, Any]] = []
        while not pages and time.monotonic() < deadline:
            with urllib.request.urlopen(f"http://{port}/json/list", timeout=START_TIMEOUT_S) as answer:
                pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None, proxy=None)

    def send_command(self, method: str, **parameters: object) -> dict[str, Any]:
        """Send a command of the DevTools protocol and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=ANSWER_TIMEOUT_S))
            if message.get("id") == self._number:
                assert "error" not in message, f"{method}: {message}"
                return dict(message["result"])
            self._record_problem(message)

    def _record_problem(self, message: dict[str, Any]) -> None:
        """Append to `problems` if a DevTools message is an uncaught exception or an error of the console."""
        event, details = message.get("method"), message.get("params", {})
        if event == "Runtime.exceptionThrown":
            self.problems.append(json.dumps(details["exceptionDetails"])[:500])
        elif event == "Runtime.consoleAPICalled" and details["type"] in {"error", "assert"}:
            self.problems.append(json.dumps(details["args"])[:500])
        elif event == "Log.entryAdded" and details["entry"]["level"] == "error":
            self.problems.append(f"{details['entry']['text']} {details['entry'].get('url', '')}")

    def evaluate(self, expression: str) -> Any:
        """Evaluate a JavaScript expression in the page, wait for its promise, and return its value as JSON data."""
        answer = self.send_command("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def read_text(self) -> str:
        """Return the visible text of the page."""
        return str(self.evaluate("document.body ? document.body.innerText : ''"))

    def take_picture(self) -> ByteArray:
        """Take a screenshot of the page, u8[height, width, 3 colours]. The attribute `png` then has the PNG file."""
        import matplotlib.image

        data = base64.b64decode(self.send_command("Page.captureScreenshot", format="png")["data"])
        self.png = data
        pixels = matplotlib.image.imread(io.BytesIO(data), format="png")[..., :3]
        picture: ByteArray = np.rint(255 * pixels).astype(np.uint8)
        return picture

    def close(self) -> None:
        """End the browser, and remove its temporary folder."""
        if hasattr(self, "_socket"):
            self._socket.close()
        self._process.terminate()
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stderr is not None
        self._process.stderr.close()
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
