"""A headless Chromium for tests, driven through chromedriver's HTTP interface (WebDriver), with
nothing to install; and a page's data as it unpacks them."""

import base64
import gzip
import json
import re
import shutil
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.reports.page.parts import TYPES

FLAGS = ("headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "disable-background-networking",
         "disable-component-update", "disable-sync", "hide-scrollbars")  # fmt: skip
PATIENCE = 60.0
"""Seconds that the browser may take to start or to draw a page."""


def missing() -> str:
    """Why there is no browser; empty if there is one."""
    absent = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    return (
        f"needs {' and '.join(absent)} (Debian: apt-get install chromium chromium-driver)"
        if absent
        else ""
    )


class Browser:
    def __init__(self, profile: Path, width: int = 1280, height: int = 1000) -> None:
        command = ["chromedriver", "--port=0"]
        self._driver = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        port = next(
            found[1]
            for line in self._driver.stdout
            if (found := re.search(r"on port (\d+)\.$", line))
        )
        self._root = f"http://127.0.0.1:{port}"
        arguments = [f"--{flag}" for flag in FLAGS]
        arguments += [f"--user-data-dir={profile}", f"--window-size={width},{height}"]
        chrome = {
            "goog:chromeOptions": {"args": arguments},
            "goog:loggingPrefs": {"browser": "ALL"},
        }
        try:
            made = self._call("POST", "/session", {"capabilities": {"alwaysMatch": chrome}})
        except BaseException:
            self._driver.kill()
            self._driver.communicate()
            raise
        self._root += f"/session/{made['sessionId']}"

    def open(self, page: Path, fragment: str = "") -> None:
        """Open a page and wait until it is drawn."""
        self._call("POST", "/url", {"url": "about:blank"})
        self._call("POST", "/url", {"url": f"{page.resolve().as_uri()}{fragment}"})
        end = time.monotonic() + PATIENCE
        while not self.run("return document.documentElement.dataset.ready === '1'"):
            if time.monotonic() > end:
                raise TimeoutError(
                    f"{page.name} was not drawn: {self.run('return document.body.innerText')}"
                )
            time.sleep(0.05)

    def run(self, script: str, *arguments: Any) -> Any:
        return self._call("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def press(self, key: str) -> None:
        event = f"new KeyboardEvent('keydown', {{key: {json.dumps(key)}, bubbles: true}})"
        self.run(f"(document.activeElement || document.body).dispatchEvent({event})")

    def command(self, name: str, **parameters: Any) -> Any:
        return self._call("POST", "/goog/cdp/execute", {"cmd": name, "params": parameters})

    def size(self, width: int, height: int, phone: bool = False) -> None:
        sizes = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone}
        self.command("Emulation.setDeviceMetricsOverride", **sizes)

    def picture(self, target: Path, clip: tuple[float, float, float, float] | None = None) -> None:
        """A PNG of the window, or of (x, y, width, height) of the page."""
        area = (
            {}
            if clip is None
            else {"clip": dict(zip(("x", "y", "width", "height"), clip, strict=True), scale=1)}
        )
        shot = self.command(
            "Page.captureScreenshot", format="png", captureBeyondViewport=True, **area
        )
        target.write_bytes(base64.b64decode(shot["data"]))

    def complaints(self) -> list[str]:
        """Errors of the console since the last call."""
        entries = self._call("POST", "/se/log", {"type": "browser"})
        return [entry["message"] for entry in entries if entry["level"] == "SEVERE"]

    def close(self) -> None:
        try:
            self._call("DELETE", "", None)
        finally:
            self._driver.terminate()
            self._driver.communicate(timeout=PATIENCE)

    def _call(self, method: str, path: str, body: Any) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self._root + path, data, {"Content-Type": "application/json"}, method=method
        )
        try:
            with urllib.request.urlopen(request, timeout=2 * PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            with error:
                raise RuntimeError(json.load(error)["value"]["message"]) from None


def text_of(browser: Browser, selector: str) -> str:
    return str(browser.run("return document.querySelector(arguments[0]).innerText", selector))


def fragment(browser: Browser) -> dict[str, str]:
    found = browser.run("return Object.fromEntries(new URLSearchParams(location.hash.slice(1)))")
    return {str(key): str(value) for key, value in found.items()}


def data_of(page: Path) -> Any:
    """The header of a page with its arrays in place."""
    found = re.search(r'id="data">([^<]*)<', page.read_text(encoding="utf-8"))
    return unpacked(found.group(1))


def unpacked(text: str) -> Any:
    raw = gzip.decompress(base64.b64decode(text))
    length = int.from_bytes(raw[:4], "little")
    start = -(-(4 + length) // 8) * 8

    def fill(node: Any) -> Any:
        if isinstance(node, list):
            return [fill(one) for one in node]
        if not isinstance(node, dict):
            return node
        if "$" in node:
            count = int(np.prod(node["s"], dtype=int))
            return np.frombuffer(raw, TYPES[node["$"]], count, start + node["o"]).reshape(node["s"])
        return {key: fill(one) for key, one in node.items()}

    return fill(json.loads(raw[4 : 4 + length]))
