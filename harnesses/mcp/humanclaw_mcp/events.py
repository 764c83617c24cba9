"""What a client is sent again whose stream was cut."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from mcp.server.streamable_http import EventCallback, EventMessage, EventStore
from mcp.server.streamable_http_manager import StreamableHTTPSessionManager
from mcp_types import JSONRPCError, JSONRPCMessage, JSONRPCResponse

KEPT = 32
"""Messages kept for a session. Each may hold a picture of 100 KB, and a client that is further behind begins anew."""


@dataclass(frozen=True)
class _Event:
    id: str
    stream: str
    message: JSONRPCMessage | None
    """None only marks the beginning of a stream."""


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
        """Send again what came after that event on its stream.

        Returns the stream if more may come on it: None if its answer has been sent, or if the event is not known.
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
    """Gives each session events of its own.

    The library would share one store among all, though its streams are named by request numbers, which every client
    counts from one: a client could be sent the pictures of another.
    """

    @property
    def event_store(self) -> Events:
        """Read once for each new session."""
        return Events()

    @event_store.setter
    def event_store(self, store: EventStore | None) -> None:
        """Take what the library sets; it is not used."""
