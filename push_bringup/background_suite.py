"""A suite that a program starts and stops while it does something else, e.g. the viewer."""

import queue
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from push_bringup.failures import DomainInUse, SuiteFailed
from push_bringup.launcher import Launcher
from push_bringup.preparation import check_domain, prepare
from push_bringup.systems import SYSTEMS, system_names
from push_model.settings import SettingsError
from push_scenario.scenario import scenario_names

_LOOK = 0.1  # [s] between two looks whether a node has died


class BackgroundSuite:
    """At most one suite at a time, of the scenarios in ``config/``. Methods may be called from any
    thread.

    One thread of its own starts and ends all processes: the system ends a process together with
    the thread that started it.
    """

    def __init__(self, namespace: str = "") -> None:
        self._namespace = namespace
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._launcher: Launcher | None = None
        self._folder = ExitStack()
        self._running = ""
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def options(self) -> dict[str, Any]:
        """``systems`` and ``scenarios`` to choose from, the ``examples`` of systems, and what is
        ``running``."""
        return {
            "systems": list(system_names()),
            "scenarios": scenario_names(),
            "examples": {name: system.example for name, system in SYSTEMS.items()},
            "running": self._running,
        }

    def start(self, system: str, scenario: str) -> str:
        """Start a suite in place of the one that runs; a sentence.

        Raises
        ------
        ValueError: it cannot be started; the text says why.
        """
        if scenario not in scenario_names():
            raise ValueError(f"no scenario '{scenario}' in config/scenarios")
        return self._do(lambda: self._start(system, scenario))

    def stop(self) -> str:
        """Stop the suite; a sentence. Raises ValueError if none runs that was started here."""
        return self._do(self._stop)

    def close(self) -> None:
        """Stop the suite, if one runs, and the thread."""
        self._work.put(None)
        self._thread.join()

    def _do(self, work: Callable[[], str]) -> str:
        answers: queue.SimpleQueue[str | Exception] = queue.SimpleQueue()

        def run() -> None:
            try:
                answers.put(work())
            except (SettingsError, SuiteFailed, DomainInUse, OSError) as error:
                answers.put(ValueError(str(error)))
            except Exception as error:
                answers.put(error)

        self._work.put(run)
        answer = answers.get()
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _start(self, system: str, scenario: str) -> str:
        setup = prepare(scenario, system=system, namespace=self._namespace)
        self._end()
        check_domain(self._namespace)
        folder = Path(self._folder.enter_context(tempfile.TemporaryDirectory("-planar-push")))
        self._launcher = Launcher(setup.write(folder))
        self._launcher.start()
        self._running = f"{system}, {scenario}"
        return f"{self._running} starts"

    def _stop(self) -> str:
        if self._launcher is None:
            raise ValueError("no suite runs that was started here")
        before = self._running
        self._end()
        return f"{before} has been stopped"

    def _end(self) -> None:
        if self._launcher is not None:
            self._launcher.stop()
        self._launcher, self._running = None, ""
        self._folder.close()

    def _serve(self) -> None:
        while True:
            try:
                work = self._work.get(timeout=_LOOK)
            except queue.Empty:
                if self._launcher is not None and self._launcher.failed():
                    self._end()
                continue
            if work is None:
                self._end()
                return
            work()
