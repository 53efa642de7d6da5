"""Starting, spinning and stopping nodes."""

import contextlib
import ctypes
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.action import ActionClient, ActionServer
from rclpy.exceptions import ParameterException
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from threadpoolctl import threadpool_limits

from push_model.settings import SettingsError
from push_ros.scheduling import RealTimePriority, Urgency, go_to_background


def prepare_environment(environment: dict[str, str] | None = None) -> dict[str, str]:
    """Defaults for a suite on one machine: local discovery, quick, one BLAS thread.

    environment: of other processes; that of this one when it is not given. BLAS rounds differently
    with another number of threads, so equal seeds would give other runs on a machine with other
    cores. The number is therefore also set in the BLAS libraries that this process has loaded.
    """
    env = os.environ if environment is None else environment
    env.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    env.setdefault("OPENBLAS_NUM_THREADS", "1")
    env.setdefault("RCUTILS_LOGGING_USE_STDOUT", "0")
    profile = Path(__file__).parent / "discovery.xml"
    env.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
    threads = env["OPENBLAS_NUM_THREADS"]
    if environment is None and threads.isdecimal() and int(threads) > 0:
        threadpool_limits(int(threads), "blas")
    return env  # type: ignore[return-value]


def die_with_parent() -> None:
    """Linux: ask for SIGTERM when the parent process ends, however it ends."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


def heard(
    node: Node,
    publisher: Any,
    state_type: str = "push_msgs/msg/JobState",
    state: str = "job_state",
) -> bool:
    """Whether what a publisher of the node sends now is heard by who owns the job.

    A count of subscriptions is not enough, it may be the recorder's: one of them must belong to a
    node that publishes the state of a job, on a topic beside that of the publisher.
    """
    known = node.get_subscriptions_info_by_topic(publisher.topic_name)
    listeners = {(info.node_namespace, info.node_name) for info in known}
    topic = publisher.topic_name.rsplit("/", 1)[0] + f"/{state}"
    owners = {
        (info.node_namespace, info.node_name)
        for info in node.get_publishers_info_by_topic(topic)
        if info.topic_type == state_type
    }
    return bool(listeners & owners) and int(publisher.get_subscription_count()) >= len(known)


class _Interrupts:
    """Signals that arrive while the main thread spins.

    An exception out of a callback makes rclpy print a traceback. The interrupt therefore waits
    until the callback has returned. A second one does not wait.
    """

    def __init__(self) -> None:
        self.spinning = self.waiting = False

    def interrupt(self) -> None:
        """Raise KeyboardInterrupt, now or at the end of the callback; for signal handlers."""
        if self.spinning and not self.waiting:
            self.waiting = True
        else:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Spin once."""
        if threading.current_thread() is not threading.main_thread() or self.spinning:
            yield
            return
        self.spinning = True
        try:
            yield
        finally:
            self.spinning = False
        if self.waiting:
            self.waiting = False
            raise KeyboardInterrupt


INTERRUPTS = _Interrupts()


class Spinner:
    """An executor for some nodes, spun by its owner.

    context: the one that the nodes were made in; the default one when it is not given.
    """

    def __init__(self, nodes: Sequence[Node], context: Any = None) -> None:
        self.nodes = list(nodes)
        self._context = context
        # It wants a standard error that is a file, which that of a notebook is not.
        with contextlib.redirect_stderr(sys.__stderr__):
            self.executor = EventsExecutor(context=context)
        for node in self.nodes:
            self.executor.add_node(node)

    def once(self, timeout: float = 0.1) -> None:
        """Handle what is there, or wait for it up to timeout [s]; without one rclpy may hang."""
        try:
            with INTERRUPTS.held():
                self.executor.spin_once(timeout)
        except (RuntimeError, RCLError) as error:
            # Bytes that are no message of the topic's type: rclpy raises out of the executor.
            if not any(word in str(error).lower() for word in ("take", "deserial", "convert")):
                raise
            get_logger("planar_push").warning(f"a message could not be read: {error}")

    def until(self, condition: Callable[[], bool], limit: float) -> bool:
        """Spin until the condition holds; False when it does not within limit [s] wall time."""
        end = time.monotonic() + limit
        while not condition():
            if time.monotonic() > end or not rclpy.ok(context=self._context):
                return False
            self.once(0.05)
        return True

    def add(self, node: Node) -> None:
        """Spin this node, too."""
        self.nodes.append(node)
        self.executor.add_node(node)

    def remove(self, node: Node) -> None:
        """Take a node out while the others go on; destroy it.

        The executor drops a node at its next event. Events that were queued before, and timers that
        these find due, are still handled; they raise InvalidHandle when the node is destroyed.
        """
        self.executor.remove_node(node)
        for _ in range(2):  # events are handled in their order: what is queued now; what it queued
            handled = self.executor.create_task(lambda: None)
            while not handled.done():
                self.once(0.05)
        self.nodes.remove(node)
        _destroy(node)

    def close(self) -> None:
        """Destroy the nodes. An executor that is left open keeps them in the graph."""
        for node in self.nodes:
            self.executor.remove_node(node)
            _destroy(node)
        self.nodes.clear()
        self.executor.shutdown()


def _destroy(node: Node) -> None:
    """Destroy a node that no executor spins."""
    for waitable in list(node.waitables):  # of which rclpy forgets those of actions
        if isinstance(waitable, (ActionClient, ActionServer)):
            waitable.destroy()
    with contextlib.suppress(Exception):
        node.destroy_node()


def _spare_collections() -> None:
    """Take what exists now out of garbage collection: it lives as long as the process.

    A collection of everything that the modules and the node have made takes about 50 ms, in which a
    controller would miss some ticks.
    """
    gc.collect()
    gc.freeze()


def run_node(
    make: Callable[[], Node],
    arguments: Sequence[str] | None = None,
    urgency: Urgency = Urgency.ORDINARY,
) -> int:
    """Run one node until a signal; returns an exit code.

    arguments: of the command line; those of this process when they are not given.
    urgency: how soon it must run. A node whose attribute ``in_real_time`` is False has no real-time
    priority.
    SIGINT and SIGTERM end the spinning; the node's ``stop`` method, if it has one, is called while
    it can still publish. Before that, its method ``finish``, if it has one, is called with the
    spinner, so that it can wait for messages that are still under way.
    """
    prepare_environment()
    stopping = False

    def on_signal(number: int, frame: Any) -> None:
        nonlocal stopping
        stopping = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    if urgency is Urgency.BACKGROUND:
        go_to_background()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    spinner: Spinner | None = None
    priority: RealTimePriority | None = None
    try:
        node = make()
        spinner = Spinner([node])
        paced = getattr(node, "in_real_time", True)
        log = node.get_logger()
        _spare_collections()
        priority = RealTimePriority(urgency if paced else Urgency.ORDINARY, log.info)
        if priority.refusal and urgency is Urgency.WORLD:  # one line in a suite, not one per node
            log.info(priority.refusal)
        while rclpy.ok() and not stopping:
            spinner.once(0.1)
            priority.look()
        finish = getattr(node, "finish", None)
        if finish is not None:
            finish(spinner)
        stop = getattr(node, "stop", None)
        if stop is not None:
            stop()
    except (SettingsError, ParameterException, FileExistsError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        pass
    finally:
        gc.unfreeze()
        if priority is not None:
            priority.close()
        if spinner is not None:
            spinner.close()
        rclpy.try_shutdown()
    return 0
