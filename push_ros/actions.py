"""Long jobs as actions, without blocking an executor.

``GoalServer`` keeps at most one goal; a new one replaces it. ``GoalClient`` sends one goal at a
time and forgets about answers to earlier ones.
"""

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node


class _Server(ActionServer):
    """Goals are EXECUTING without a task: the events executor would poll one all the time."""

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Called by ``goal_handle.execute()``: the work is done by the owner, in callbacks."""

    def deliver(self, goal_handle: Any, end: Callable[[Any], Any]) -> None:
        """End the goal in a task that does not wait; ``end`` returns the result."""
        super().notify_execute(goal_handle, end)


class GoalServer:
    """An action server for one goal at a time.

    check: raises an exception whose text is logged when the goal must be rejected.
    refuse: result for a goal that is accepted only to be told why it cannot be; None where it can.
    A goal that is rejected or refused leaves the one under way alone.
    consider: in the place of refuse, for what takes time: called with the request and a function
    that is to be called once, now or later, with what refuse would have returned. A goal that is
    canceled meanwhile is not taken.
    preempt: called with the new goal's request before it is taken; the owner ends what is under
    way, whoever asked for it, and a goal of this server with ``finish``.
    start: called with the new goal's request.
    cancel: called when the goal under way shall end; the owner answers with ``finish``.
    """

    def __init__(
        self,
        node: Node,
        action: Any,
        name: str,
        *,
        check: Callable[[Any], None],
        start: Callable[[Any], None],
        cancel: Callable[[], None],
        preempt: Callable[[Any], None],
        refuse: Callable[[Any], Any] = lambda request: None,
        consider: Callable[[Any, Callable[[Any], None]], None] | None = None,
    ) -> None:
        self._node = node
        self._check, self._start, self._cancel = check, start, cancel
        self._preempt = preempt
        self._consider = consider or (lambda request, answer: answer(refuse(request)))
        self._handle: Any = None
        self._considered: list[Any] = []
        self._result = action.Result
        self._server = _Server(
            node,
            action,
            name,
            execute_callback=lambda handle: None,  # rclpy wants one; notify_execute is ours
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            result_timeout=30,
        )

    @property
    def active(self) -> bool:
        """Whether a goal is under way."""
        return self._handle is not None

    def _on_goal(self, request: Any) -> GoalResponse:
        try:
            self._check(request)
        except Exception as error:  # a bad goal must never end the node
            self._node.get_logger().warning(f"goal rejected: {error}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: Any) -> None:
        handle.execute()
        self._considered.append(handle)
        self._consider(handle.request, lambda refusal: self._judged(handle, refusal))

    def _judged(self, handle: Any, refusal: Any) -> None:
        self._considered.remove(handle)
        if refusal is None and handle.is_cancel_requested:
            refusal = self._result()
        if refusal is not None:
            self._server.deliver(handle, lambda h: self._deliver(h, refusal, False))
            return
        self._preempt(handle.request)
        self._handle = handle
        self._start(handle.request)

    def _on_cancel(self, handle: Any) -> CancelResponse:
        # The handle given here is a copy; compare by goal id.
        goal = bytes(handle.goal_id.uuid)
        if any(bytes(h.goal_id.uuid) == goal for h in self._considered):
            return CancelResponse.ACCEPT
        if self._handle is None or goal != bytes(self._handle.goal_id.uuid):
            return CancelResponse.REJECT
        self._cancel()
        return CancelResponse.ACCEPT

    def feedback(self, message: Any) -> None:
        """Publish feedback on the current goal, if there is one."""
        if self._handle is not None:
            self._handle.publish_feedback(message)

    def finish(self, result: Any, success: bool) -> None:
        """End the current goal, if there is one."""
        handle, self._handle = self._handle, None
        if handle is None:
            return
        self._server.deliver(handle, lambda h: self._deliver(h, result, success))

    def _deliver(self, handle: Any, result: Any, success: bool) -> Any:
        if handle.is_cancel_requested:
            handle.canceled()
        elif success:
            handle.succeed()
        else:
            handle.abort()
        return result


class GoalClient:
    """An action client that follows its newest goal only."""

    def __init__(self, node: Node, action: Any, name: str) -> None:
        self.name = name
        self._client = ActionClient(node, action, name)
        self._token = 0
        self._handle: Any = None

    @property
    def ready(self) -> bool:
        """Whether a server is there."""
        return bool(self._client.server_is_ready())

    def send(
        self,
        goal: Any,
        done: Callable[[Any], None],
        feedback: Callable[[Any], None] | None = None,
        cancel: bool = True,
    ) -> None:
        """Send a goal; ``done`` gets the result, or None when the goal was rejected.

        cancel: whether the goal before is canceled; if not, the server replaces it.
        """
        kept = None if cancel else self._handle
        if not cancel:
            self._handle = None
        self.forget()
        token = self._token

        def on_feedback(message: Any) -> None:
            if token == self._token and feedback is not None:
                feedback(message.feedback)

        def on_response(future: Any) -> None:
            handle = future.result()
            if kept is not None and (handle is None or not handle.accepted):
                kept.cancel_goal_async()  # nothing has replaced it
            if token != self._token:
                if handle is not None and handle.accepted:
                    handle.cancel_goal_async()  # canceled before it was accepted
                return
            if handle is None or not handle.accepted:
                done(None)
                return
            self._handle = handle
            handle.get_result_async().add_done_callback(on_result)

        def on_result(future: Any) -> None:
            if token == self._token:
                self._handle = None
                answer = future.result()
                done(None if answer is None else answer.result)

        self._client.send_goal_async(goal, on_feedback).add_done_callback(on_response)

    def forget(self) -> None:
        """Cancel the goal under way and ignore whatever still comes of it."""
        self._token += 1
        handle, self._handle = self._handle, None
        if handle is not None:
            handle.cancel_goal_async()
