"""The requests of a page, by path: what each expects, and what it asks for."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from push_view.viewer_node import NotTaken, ViewerNode


class Starter(Protocol):
    """Starts and stops suites for the page. Methods are called from the server's threads."""

    def options(self) -> dict[str, Any]:
        """``systems`` and ``scenarios`` to choose from, and ``running``: what it started last."""
        ...

    def start(self, system: str, scenario: str) -> str:
        """Start a suite; a sentence. Raises ValueError if it cannot be started."""
        ...

    def stop(self) -> str:
        """Stop the suite that it started; a sentence. Raises ValueError if there is none."""
        ...


Request = Callable[[Mapping[str, Any]], dict[str, Any]]

_LONGEST = 1000  # characters of a text


class PageRequests:
    """What ``POST`` does. Each request raises NotTaken, or ValueError for a body that is wrong."""

    def __init__(self, node: ViewerNode, starter: Starter | None = None) -> None:
        self._node, self._starter = node, starter
        self.routes: dict[str, Request] = {
            "/goal": self._goal,
            "/cancel": lambda v: {"text": node.cancel(_text(v, "space", ""))},
            "/execute": lambda v: {"text": node.execute(_text(v, "space", ""))},
            "/pause": lambda v: self._control("pause", paused=_flag(v, "paused")),
            "/reset": lambda v: self._control("reset"),
            "/displace": lambda v: self._control("displace", name=_text(v, "name"), **_pose(v)),
            "/kill": lambda v: self._control("kill", robot=_text(v, "robot")),
            "/start": self._start,
            "/stop": self._stop,
        }

    def options(self) -> dict[str, Any]:
        """What can be started from the page."""
        if self._starter is None:
            return {"systems": [], "scenarios": [], "running": ""}
        return self._starter.options()

    def answer(self, path: str, body: bytes) -> dict[str, Any]:
        """Carry out a request.

        Raises
        ------
        KeyError: nothing is at that path. ValueError: the body is not what is expected. NotTaken.
        """
        request = self.routes[path]
        try:
            values = json.loads(body or b"{}")
        except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ValueError(f"expected JSON: {error}") from None
        if not isinstance(values, dict):
            raise ValueError("expected a JSON object")
        return request(values)

    def _goal(self, values: Mapping[str, Any]) -> dict[str, Any]:
        preview = _flag(values, "preview", False)
        stamp = self._node.send_goal(_text(values, "space", ""), **_pose(values), preview=preview)
        return {"stamp": stamp}

    def _control(self, request: str, **values: Any) -> dict[str, Any]:
        return {"text": self._node.control(request, values)}

    def _start(self, values: Mapping[str, Any]) -> dict[str, Any]:
        system, scenario = _text(values, "system"), _text(values, "scenario")
        return {"text": self._started(lambda starter: starter.start(system, scenario))}

    def _stop(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {"text": self._started(lambda starter: starter.stop())}

    def _started(self, ask: Callable[[Starter], str]) -> str:
        if self._starter is None:
            raise NotTaken("this viewer starts no suites; planar-push view does")
        try:
            return ask(self._starter)
        except ValueError as error:
            raise NotTaken(str(error)) from None


def _text(values: Mapping[str, Any], name: str, default: str | None = None) -> str:
    value = values.get(name, default)
    if not isinstance(value, str):
        raise ValueError(f"{name}: expected text, got {value!r}")
    if len(value) > _LONGEST:
        raise ValueError(f"{name}: expected text of at most {_LONGEST} characters")
    try:
        value.encode()  # JSON may hold halves of characters; messages and answers may not
    except UnicodeEncodeError:
        raise ValueError(
            f"{name}: expected text that can be encoded as UTF-8, got {value!r}"
        ) from None
    return value


def _flag(values: Mapping[str, Any], name: str, default: bool | None = None) -> bool:
    value = values.get(name, default)
    if not isinstance(value, bool):
        raise ValueError(f"{name}: expected true or false, got {value!r}")
    return value


def _pose(values: Mapping[str, Any]) -> dict[str, float]:
    result = {}
    for name in ("x", "y", "theta"):
        value = values.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"{name}: expected a number, got {value!r}")
        try:
            number = float(value)
        except (ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise ValueError(f"{name}: expected a finite number, got {value!r}")
        result[name] = number
    return result
