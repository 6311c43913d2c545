"""A headless Chromium for tests, driven through its debugging pipe: opens pages, inspects and operates them."""

import json
import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import Any

NAMES = ("chromium", "chromium-headless-shell", "chromium-browser", "google-chrome")
PROGRAM = next((path for name in NAMES if (path := shutil.which(name))), None)

NOISE = "GL Driver Message"
"""A message of the console about drawing without a graphics card."""

PATIENCE = 90.0
"""Maximum seconds to wait for an answer."""

WITH_PIPE = """
import fcntl, os, sys
pipe = [fcntl.fcntl(int(one), fcntl.F_DUPFD, 10) for one in sys.argv[1:3]]
os.dup2(pipe[0], 3)
os.dup2(pipe[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Replaces itself by a program with two of our files as descriptors 3 and 4, where Chromium looks for its pipe."""


class Browser:
    """One page. `problems` are its console's complaints, `requests` the addresses that it requested."""

    def __init__(self, sent: Any, answers: int) -> None:
        self._sent, self._answers, self._number, self._session, self._read = sent, answers, 0, {}, b""
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.loaded = False
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the debugging protocol, and return its result."""
        self._number += 1
        number = self._number
        message = {"id": number, "method": method, "params": parameters, **self._session}
        self._sent.write(json.dumps(message).encode() + b"\0")
        self._sent.flush()
        while True:
            answer = self._receive()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._read:
            assert select.select([self._answers], [], [], PATIENCE)[0], "Chromium does not answer"
            piece = os.read(self._answers, 1 << 16)
            assert piece, "Chromium ended"
            self._read += piece
        line, _, self._read = self._read.partition(b"\0")
        message = json.loads(line)
        event, details = message.get("method"), message.get("params", {})
        if event == "Runtime.exceptionThrown":
            self.problems.append(json.dumps(details["exceptionDetails"])[:600])
        elif event == "Runtime.consoleAPICalled" and details["type"] in ("error", "warning", "assert"):
            self.problems.append(str(details["args"])[:600])
        elif event == "Log.entryAdded" and details["entry"]["level"] in ("error", "warning"):
            if NOISE not in details["entry"]["text"]:
                self.problems.append(f"{details['entry']['text']} {details['entry'].get('url', '')}")
        elif event == "Network.requestWillBeSent":
            self.requests.append(details["request"]["url"])
        elif event == "Page.loadEventFired":
            self.loaded = True
        return message

    def close(self) -> None:
        """End the browser with all of its processes."""
        self._session = {}
        self.call("Browser.close")

    def open(
        self, address: str, *, width: int = 1440, height: int = 900, dark: bool = False, script: bool = True
    ) -> None:
        """Open a page of this size in pixels, and wait until it is loaded."""
        phone = width < 600
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        calm = {"name": "prefers-reduced-motion", "value": "reduce"}
        self.call("Emulation.setEmulatedMedia", features=[scheme, calm])
        self.call("Emulation.setScriptExecutionDisabled", value=not script)
        self.loaded = False
        # A page that differs only in the fragment would not be reloaded.
        place, mark, fragment = address.partition("#")
        self.call("Page.navigate", url=f"{place}?{self._number}{mark}{fragment}")
        while not self.loaded:
            self._receive()

    def run(self, expression: str) -> Any:
        """Return the value of a JavaScript expression, awaited."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def settle(self) -> None:
        """Wait until the page has drawn pending changes."""
        self.run("new Promise((done) => setTimeout(() => [requestAnimationFrame(done), setTimeout(done, 300)], 450))")

    def mouse(self, *moves: tuple[str, float, float]) -> None:
        """Send events of the left button: ("pressed" | "moved" | "released", x, y), in pixels of the page."""
        held = 0
        for what, x, y in moves:
            held = {"pressed": 1, "released": 0}.get(what, held)
            details = {"button": "left", "clickCount": 1} if what != "moved" else {"button": "left" if held else "none"}
            self.call("Input.dispatchMouseEvent", type=f"mouse{what.title()}", x=x, y=y, buttons=held, **details)

    def press(self, key: str, *, shift: bool = False) -> None:
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            extra = text if kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 * shift, **extra)


@contextmanager
def browser() -> Iterator[Browser]:
    """Start a Chromium, which ends with the block."""
    (from_us, to_it), (from_it, to_us) = os.pipe(), os.pipe()
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        arguments = ["--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--no-first-run", "--mute-audio",
                     "--disable-dev-shm-usage", "--disable-background-networking", "--enable-unsafe-swiftshader",
                     f"--user-data-dir={profile}"]  # fmt: skip
        process = subprocess.Popen(
            [sys.executable, "-c", WITH_PIPE, str(from_us), str(to_us), str(PROGRAM), *arguments],
            pass_fds=(from_us, to_us),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(from_us)
        os.close(to_us)
        with os.fdopen(to_it, "wb") as sent, os.fdopen(from_it, "rb") as answers:
            try:
                page = Browser(sent, answers.fileno())
                yield page
                page.close()
                process.wait(timeout=20)
            finally:
                process.kill()
                process.wait()
