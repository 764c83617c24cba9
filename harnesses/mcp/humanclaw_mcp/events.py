"""HTTP sessions: places for newcomers, and messages kept for streams that were cut."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mcp.server.streamable_http import EventCallback, EventMessage, EventStore
from mcp.server.streamable_http_manager import StreamableHTTPSessionManager
from mcp_types import JSONRPCError, JSONRPCMessage, JSONRPCResponse
from starlette.types import Receive, Scope, Send

from humanclaw_mcp.settings import SESSION_HEADER

KEPT = 32
"""Messages kept for a session, each with a picture of up to 100 KB. A client that missed more must start again."""


@dataclass(frozen=True)
class _Event:
    id: str
    stream: str
    message: JSONRPCMessage | None
    """None marks the beginning of a stream."""


class Events(EventStore):
    """The last messages of one session."""

    def __init__(self, kept: int = KEPT) -> None:
        self._events: deque[_Event] = deque(maxlen=kept)
        self._count = 0

    async def store_event(self, stream_id: str, message: JSONRPCMessage | None) -> str:
        self._count += 1
        self._events.append(_Event(str(self._count), stream_id, message))
        return str(self._count)

    async def replay_events_after(self, last_event_id: str, send_callback: EventCallback) -> str | None:
        """Resend the messages after an event on its stream.

        Returns the stream if more may follow; None if its answer has been sent, or if the event is unknown.
        """
        last = next((event for event in self._events if event.id == last_event_id), None)
        if last is None:
            return None
        missed = [event for event in self._events if event.stream == last.stream and int(event.id) > int(last.id)]
        for event in missed:
            if event.message:
                await send_callback(EventMessage(event.message, event.id))
        answered = any(isinstance(event.message, JSONRPCResponse | JSONRPCError) for event in missed)
        return None if answered else last.stream


class SessionManager(StreamableHTTPSessionManager):
    """Gives each session its own events, and a newcomer the place of a silent session without a body.

    The library would share one event store. It names streams by request numbers, which every client counts from one,
    so a client could get the pictures of another. At the limit of sessions it would refuse newcomers until one expires.
    """

    def __init__(self, *args: Any, in_use: Callable[[str], bool], **options: Any) -> None:
        """in_use: whether a session has a body; such a session is never ended for a newcomer."""
        super().__init__(*args, **options)
        self._in_use = in_use

    async def _handle_request(self, scope: Scope, receive: Receive, send: Send) -> None:
        if SESSION_HEADER.encode() not in dict(scope["headers"]):
            await self._make_room()
        await super()._handle_request(scope, receive, send)

    async def _make_room(self) -> None:
        """At the limit, end the session that has been silent longest; those with an open stream come last."""
        while self.max_sessions and len(self._server_instances) >= self.max_sessions:
            idle = [key for key in self._server_instances if not self._in_use(key)]
            if not idle:
                return
            oldest = min(idle, key=self._silent_since)
            await self._discard_session(oldest, self._server_instances[oldest])

    def _silent_since(self, key: str) -> float:
        scope = self._server_instances[key].idle_scope
        return scope.deadline if scope else math.inf

    @property
    def event_store(self) -> Events:
        """A new store: the library reads this property once for each session."""
        return Events()

    @event_store.setter
    def event_store(self, store: EventStore | None) -> None:
        """Ignore the store that the library sets."""
