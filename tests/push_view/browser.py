"""A headless Chromium, where there is one, driven through its debugging pipe."""

import base64
import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import time

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One page of a browser. Calls block until it has answered."""

    def __init__(self, profile, width=1200, height=760):
        here_in, there_out = os.pipe()
        there_in, here_out = os.pipe()
        ends = [fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (there_in, there_out)]

        # Nothing of this process, nor of Popen, may be called 3 or 4 when the child takes them.
        taken = [os.open(os.devnull, os.O_RDONLY)]
        while taken[-1] < 5:
            taken.append(os.open(os.devnull, os.O_RDONLY))

        def connect():
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        words = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
        words += [f"--user-data-dir={profile}", f"--window-size={width},{height}", "--no-first-run"]
        words += ["--remote-debugging-pipe", "--disable-background-networking", "about:blank"]
        self._process = subprocess.Popen(
            [CHROMIUM, *words],
            pass_fds=(3, 4),
            preexec_fn=connect,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for fd in (there_in, there_out, *ends, *taken):
            os.close(fd)
        self._in, self._out = os.fdopen(here_in, "rb"), os.fdopen(here_out, "wb")
        self._buffer = b""
        self._number = 0
        self._session = None
        self.errors = []  # what the page threw or logged as an error
        target = self.call("Target.createTarget", url="about:blank")
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        self.call("Page.enable")
        self.call("Runtime.enable")
        self.call("Log.enable")
        self.resize(width, height)

    def call(self, method, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        self._out.flush()
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self._note(answer.get("method"), answer.get("params", {}))

    def _note(self, event, told):
        """Keep what the console shows as an error: exceptions, console.error, failed requests."""
        if event == "Runtime.exceptionThrown":
            self.errors.append(told["exceptionDetails"])
        elif event == "Runtime.consoleAPICalled" and told["type"] in ("error", "assert"):
            self.errors.append([a.get("value", a.get("description")) for a in told["args"]])
        elif event == "Log.entryAdded" and told["entry"]["level"] == "error":
            self.errors.append(told["entry"])

    def _read(self):
        while b"\0" not in self._buffer:
            data = os.read(self._in.fileno(), 1 << 16)
            assert data, "the browser has ended"
            self._buffer += data
        text, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(text)

    def open(self, url):
        self.call("Page.navigate", url=url)
        while self.value("document.readyState") != "complete" or self.value("location.href") != url:
            time.sleep(0.02)

    def value(self, expression):
        """The value of a JavaScript expression; a promise is awaited."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def resize(self, width, height):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def mouse(self, kind, x, y, button="left"):
        """kind: mousePressed, mouseMoved or mouseReleased, at a place in CSS pixels."""
        held = 0 if kind == "mouseReleased" else {"left": 1, "right": 2}[button]
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button=button,
            buttons=held,
            clickCount=1,
        )

    def key(self, name):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name)

    def picture(self, path):
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))

    def close(self):
        with contextlib.suppress(Exception):
            self._session = None
            self.call("Browser.close")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        self._process.kill()
        self._process.wait()
        self._in.close()
        with contextlib.suppress(OSError):
            self._out.close()
