"""Notifications to clients: progress of a call, log messages, and changed resources.

A client gets them only if it asked: with a progress token, with logging/setLevel, or with a subscription.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar, get_args

import anyio
import anyio.to_thread
import mcp_types as types
from mcp.server.context import ServerRequestContext
from mcp.server.subscriptions import InMemorySubscriptionBus, ResourceUpdated
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS

Context = ServerRequestContext[str, Any]
T = TypeVar("T")
LEVELS: Final[tuple[types.LoggingLevel, ...]] = get_args(types.LoggingLevel)
"""From the least to the most severe."""
_LOGGER: Final = "humanclaw"


@dataclass
class Subscription:
    """The notifications that a session asked for."""

    level: types.LoggingLevel | None = None
    """Least severity of log messages; None for no messages."""
    uris: set[str] = field(default_factory=set)


class Subscriptions:
    """The subscriptions of all sessions; beyond the limit the least recently used is dropped."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._by_session: OrderedDict[str, Subscription] = OrderedDict()

    def of(self, key: str) -> Subscription:
        subscription = self._by_session.setdefault(key, Subscription())
        self._by_session.move_to_end(key)
        if len(self._by_session) > self._limit:
            self._by_session.popitem(last=False)
        return subscription


async def log(ctx: Context, subscription: Subscription, level: types.LoggingLevel, words: str) -> None:
    """Send a log message on the stream of its request."""
    if subscription.level is None or LEVELS.index(level) < LEVELS.index(subscription.level):
        return
    params = types.LoggingMessageNotificationParams(level=level, logger=_LOGGER, data=words)
    await ctx.session.send_notification(types.LoggingMessageNotification(params=params), ctx.request_id)


async def changed(ctx: Context, subscription: Subscription, bus: InMemorySubscriptionBus, uris: Iterable[str]) -> None:
    """Announce changed resources, in the way of the client's protocol version."""
    for uri in uris:
        if ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
            await bus.publish(ResourceUpdated(uri=uri))
        elif uri in subscription.uris:
            await ctx.session.send_resource_updated(uri)


async def apart(ctx: Context, work: Callable[[], T], doing: Callable[[], str], every: float) -> T:
    """Run work on a thread, so that the event loop serves other clients meanwhile. Raises what the work raises.

    A client with a progress token gets a message at once and then at intervals: the seconds so far and `doing()`.
    """
    began = time.monotonic()

    async def tell() -> None:
        while True:
            await ctx.session.report_progress(round(time.monotonic() - began, 3), message=doing())
            await anyio.sleep(every)

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(tell)
        outcome = await anyio.to_thread.run_sync(_caught(work))
        tasks.cancel_scope.cancel()
    if isinstance(outcome, Exception):
        raise outcome
    return outcome


def _caught(work: Callable[[], T]) -> Callable[[], T | Exception]:
    """Make the work return its error: raised inside a task group, it would become an exception group."""

    def run() -> T | Exception:
        try:
            return work()
        except Exception as error:
            return error

    return run
