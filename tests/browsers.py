"""A browser without a window, to look at what pages show."""

import base64
import json
import os
import select
import shutil
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

BROWSER = shutil.which("chromium")

OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars")

IS_READY = "document.documentElement && document.documentElement.dataset.ready"  # set by pages of ours


class Driven:
    """A browser that does what it is told, and says what its console and the network said: for pages that are used."""

    def __init__(self, profile: Path, *arguments: str) -> None:
        """Start it, in real time; end it by `close`."""
        assert BROWSER is not None
        (read, self._write), (self._read, write) = os.pipe(), os.pipe()
        command = [BROWSER, *OPTIONS, f"--user-data-dir={profile}", "--remote-debugging-pipe", *arguments]
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{read} 4>&{write}', "browser", *command],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(read, write),
        )
        os.close(read), os.close(write)
        self._number, self._received, self.said = 0, b"", list[str]()
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self._call(f"{domain}.enable")

    def _call(self, method: str, **parameters: object) -> dict[str, Any]:
        self._number += 1
        session = {"sessionId": self._session} if hasattr(self, "_session") else {}
        command = {"id": self._number, "method": method, "params": parameters, **session}
        os.write(self._write, json.dumps(command).encode() + b"\0")
        while True:
            message = self._message()
            if message.get("id") == self._number:
                assert "error" not in message, message["error"]
                return message["result"]
            self._note(message)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._received:
            assert select.select([self._read], [], [], 120)[0], "the browser says nothing"
            self._received += os.read(self._read, 1 << 20)
        message, _, self._received = self._received.partition(b"\0")
        return json.loads(message)

    def _note(self, message: dict[str, Any]) -> None:
        method, parameters = message.get("method"), message.get("params", {})
        if method in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"):
            self.said.append(json.dumps(parameters)[:1000])
        if method == "Network.requestWillBeSent":
            self.said.append(f"asks for {parameters['request']['url'][:200]}")

    def open(self, address: str, is_ready: str = IS_READY) -> None:
        """Go to a page, and wait until an expression in it is true."""
        self._call("Page.navigate", url=address)
        for _ in range(600):
            with suppress(AssertionError):  # the page may change while it is asked
                if self.run(f"location.href !== 'about:blank' && {is_ready}"):
                    return
            time.sleep(0.05)
        raise AssertionError(f"{address} is not ready: {self.said}")

    def run(self, code: str) -> Any:
        """Return the value of an expression in the page, which may be a promise."""
        found = self._call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def picture(self, path: Path) -> None:
        shot = self._call("Page.captureScreenshot", captureBeyondViewport=False)
        path.write_bytes(base64.b64decode(shot["data"]))

    def set_window(self, width: int, height: int, *, is_dark: bool = False, is_calm: bool = False) -> None:
        """Give the page another window, light or dark, of somebody who wants little motion or does not care."""
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        wants = {"color-scheme": "dark" if is_dark else "light", "reduced-motion": "reduce" if is_calm else ""}
        features = [{"name": f"prefers-{name}", "value": value} for name, value in wants.items()]
        self._call("Emulation.setEmulatedMedia", features=features)

    def leave(self) -> None:
        """Leave the page, which would draw itself for ever."""
        self._call("Page.navigate", url="about:blank")

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(20)
        os.close(self._read), os.close(self._write)
