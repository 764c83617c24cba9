"""What a client is told while a call is under way and after it: progress, log messages, resources that have changed.

Each is sent only to a client that asked for it: with a progress token, with logging/setLevel, with a subscription.
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
    """What one session subscribes to."""

    level: types.LoggingLevel | None = None
    """The least severe log messages that are sent; None for none."""
    uris: set[str] = field(default_factory=set)


class Subscriptions:
    """The subscriptions of every session; those of the longest silent are forgotten beyond the limit."""

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
    """Send a log message, on the stream of the request that it is about."""
    if subscription.level is None or LEVELS.index(level) < LEVELS.index(subscription.level):
        return
    params = types.LoggingMessageNotificationParams(level=level, logger=_LOGGER, data=words)
    await ctx.session.send_notification(types.LoggingMessageNotification(params=params), ctx.request_id)


async def changed(ctx: Context, subscription: Subscription, bus: InMemorySubscriptionBus, uris: Iterable[str]) -> None:
    """Tell of resources that have changed: one by one to those who subscribed, as the protocol version has it."""
    for uri in uris:
        if ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
            await bus.publish(ResourceUpdated(uri=uri))
        elif uri in subscription.uris:
            await ctx.session.send_resource_updated(uri)


async def apart(ctx: Context, work: Callable[[], T], doing: Callable[[], str], every: float) -> T:
    """Do the work off the event loop: a body takes a second, and other clients shall be heard meanwhile.

    A client that asked for it is told at once and every so many seconds how long the call has taken, and what it waits
    for.
    Raises what the work raises.
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
    """Return an error as a value: a task group would wrap it in a group of errors."""

    def run() -> T | Exception:
        try:
            return work()
        except Exception as error:
            return error

    return run
