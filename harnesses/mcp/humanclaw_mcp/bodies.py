"""The bodies of a server: one for each session."""

from __future__ import annotations

import threading
import time

import anyio
import anyio.to_thread

from humanclaw import HumanclawError, Plugins
from humanclaw_mcp.house import House, SeatedSession
from humanclaw_mcp.session import Session, Settings


class Bodies:
    """One body for each session, up to a limit. Used from one event loop; the bodies move on worker threads."""

    def __init__(self, settings: Settings, plugins: Plugins | None = None) -> None:
        """plugins: shared by all sessions; by default the installed ones."""
        self.settings = settings
        self.plugins = plugins or Plugins.discover()
        self._motion_lock = threading.Lock()
        self._house = House(self.plugins, settings)
        self._sessions: dict[str, Session] = {}
        self._evicted: set[str] = set()

    def __len__(self) -> int:
        return len(self._sessions)

    def find(self, key: str) -> Session | None:
        return self._sessions.get(key)

    def of(self, key: str, client: str, asked: str = "") -> Session:
        """Return the body of a session; make it if there is none.

        asked: number of the body in a house that is shared, or nothing for any.
        Raises HumanclawError at the limit, and once after an idle body was closed: a client must not take a new body
        for the old one.
        """
        if key in self._evicted:
            self._evicted.remove(key)
            idle = f"your body was put away after {self.settings.idle:g} seconds without a call."
            raise HumanclawError(idle, "Call look to begin with a new one.")
        if key not in self._sessions and self.settings.company:
            self._sessions[key] = SeatedSession(self._house, self._house.take(asked), client)
        if key not in self._sessions:
            if len(self) >= self.settings.bodies:
                raise HumanclawError(
                    f"all {self.settings.bodies} bodies of this server are in use.",
                    "Try again later, end another session, or start the server with a larger --bodies.",
                )
            self._sessions[key] = Session(self.plugins, self.settings, self._motion_lock, client)
        return self._sessions[key]

    async def release(self, key: str) -> None:
        """Close a session's body, if it has one."""
        self._evicted.discard(key)
        session = self._sessions.pop(key, None)
        if session:
            await anyio.to_thread.run_sync(session.close)

    async def evict_idle(self) -> None:
        """Close the bodies without a call for `idle` seconds."""
        oldest = time.monotonic() - self.settings.idle
        for key in [key for key, session in self._sessions.items() if session.used < oldest and not session.busy]:
            await self.release(key)
            self._evicted.add(key)

    async def reap_idle(self) -> None:
        """Release idle bodies while the server runs."""
        while True:
            await anyio.sleep(min(self.settings.idle / 4, 30.0))
            await self.evict_idle()

    async def close(self) -> None:
        """Close all bodies; running calls stop after their current chunk of motion."""
        for session in self._sessions.values():
            session.stop()
        for key in list(self._sessions):
            await self.release(key)
