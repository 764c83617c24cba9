"""One house that all sessions share, each with a body of its own: they move together and are recorded side by side."""

from __future__ import annotations

import threading
from contextlib import nullcontext
from dataclasses import replace

from humanclaw import Company, Episode, HumanclawError, Plugins, places_together
from humanclaw.records import free_episode
from humanclaw.world import geodesics
from humanclaw_mcp.session import Session, Settings, Snapshot, Task, new_title, verifier_of


class House:
    """Made for the first call of a session, and freed after the last session. Thread-safe."""

    def __init__(self, plugins: Plugins, settings: Settings) -> None:
        self.plugins, self.settings = plugins, settings
        self._changing = threading.Lock()
        self._taken = set[int]()
        self._company: Company | None = None
        self._episodes: tuple[Episode, ...] = ()

    def take(self, asked: str) -> int:
        """Return the number of a body that is from now on one session's. asked: that number, or nothing for any.

        Who takes one whose session has ended goes on with its episode. Raises HumanclawError if no such body is free.
        """
        with self._changing:
            free = self.free
            fitting = [number for number in free if asked in ("", str(number))]
            if not fitting:
                fault = f"body {asked[:20]!r} of {self.settings.company} is not free" if asked else "no body is free"
                others = f"Ask for {' or '.join(map(str, free))}, or" if free else "Try again"
                wait = f"at the latest {self.settings.idle:g} s after its last call"
                raise HumanclawError(
                    f"{fault} in this house.", f"{others} once its session has ended, {wait}: then you go on with it."
                )
            self._taken.add(fitting[0])
            if self._company:
                self._company.join(fitting[0] - 1)
            return fitting[0]

    @property
    def free(self) -> list[int]:
        """The bodies that no session has."""
        return [number for number in range(1, self.settings.company + 1) if number not in self._taken]

    def episode(self, number: int) -> Episode:
        """Return the episode of a body. The first who asks begins those of all."""
        with self._changing:
            if not self._episodes:
                self._begin()
            return self._episodes[number - 1]

    def stand(self, number: int) -> None:
        """Let a body stand from now on, whatever it is told."""
        if self._company:
            self._company.leave(number - 1)

    def leave(self, number: int) -> None:
        """Let a body stand until another session takes it; after the last one end the house and all its episodes."""
        with self._changing:
            self.stand(number)
            self._taken.discard(number)
            if self._taken:
                return
            for episode in self._episodes:
                episode.close()
            self._close()
            self._episodes = ()

    def _close(self) -> None:
        if self._company:
            self._company.close()
            self._company = None

    def _begin(self) -> None:
        self._close()  # If it failed before.
        asked, title = self.settings, new_title()
        scene = self.plugins.scene(asked.scenes[0])
        starts = places_together(scene, asked.company)
        names = [f"{title}-{number}" for number in range(1, asked.company + 1)]
        company = self._company = Company(
            scene, starts, seed=asked.seed, plugins=self.plugins, backends=asked.backends(), patience=asked.patience
        )
        specs = [
            free_episode(asked.instruction, scene, seed=asked.seed + number, max_steps=asked.max_steps, name=name)
            for number, name in enumerate(names)
        ]
        self._episodes = tuple(
            Episode(
                body, spec.model_copy(update={"start": start}), "mcp", verifier_of(self.plugins, asked),
                folder=asked.out / spec.id if asked.out else None, distance=geodesics, company=names,
            )
            for body, spec, start in zip(company.bodies, specs, starts, strict=True)
        )  # fmt: skip
        company.join()


class SeatedSession(Session):
    """The session of one body of a house: its only episode, since the bodies of a house begin together."""

    next_episode = "This house begins anew once all its sessions have ended."
    moving = "The bodies of this house move together; one that is silent is waited for."

    def __init__(self, house: House, number: int, client: str = "") -> None:
        super().__init__(house.plugins, house.settings, nullcontext(), client)
        self._house, self._number = house, number

    def restart(self, task: Task) -> Snapshot:
        raise HumanclawError("other bodies are in this house.", self.next_episode)

    def stop(self) -> None:
        super().stop()
        self._house.stand(self._number)

    def _begin(self) -> Episode:
        self._episode = self._house.episode(self._number)
        return self._episode

    def _end(self) -> None:
        """Leave the episode open: another session may go on with it."""
        self._episode = None

    def _put_away(self) -> None:
        self._house.leave(self._number)

    def _snapshot(self, episode: Episode, feedback: str = "", refused: bool = False) -> Snapshot:
        """Return the state now: others may have gone on since the last call."""
        if len(episode.steps) < 2 and (free := self._house.free):
            missing = " and ".join(map(str, free))
            notice = f"Nobody has body {missing} yet: the first move waits {self._settings.patience:g} s for it."
            feedback = f"{feedback} {notice}".strip()
        return replace(super()._snapshot(episode, feedback, refused), rgb=episode.body.view().rgb)
