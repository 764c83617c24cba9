"""Let objects at rest sleep until something moving comes near. Asleep they cost almost nothing and do not creep."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_mujoco.contacts import NEAR, disturbed
from humanclaw_mujoco.model import HINGED, MOVABLE, Model

_STILL: Final = 0.01
"""Speed below which an object falls asleep by itself, m/s and rad/s."""
_PATIENCE: Final = 60
"""Number of steps for which it must stay that slow, with nothing awake near it."""


class Sleep:
    """Which movable objects of a world are asleep."""

    def __init__(self, model: Model) -> None:
        """Begin with all objects awake."""
        self._model, self._affinity = model.mj, model.mj.geom_conaffinity
        self._hinges, self._hinge_dofs = model.hinges, np.array([dof for _, dof, _ in model.hinged.values()], int)
        self._frictions = np.array([leaf.joint.friction for _, _, leaf in model.hinged.values()])
        keys = [*model.movable, *model.hinged]
        places = {key: place for place, key in enumerate(keys)}
        # A hinged object has one velocity, repeated six times so that both kinds fit one array.
        free = [[dof + k for k in range(6)] for _, dof, _ in model.movable.values()]
        self._dofs = np.array([*free, *([dof] * 6 for _, dof, _ in model.hinged.values())], int).reshape(-1, 6)
        self._place_of = np.array([places.get(key, len(keys)) for key in model.object_of.tolist()])
        """Geom to the place of its movable object; one past the last for fixed objects and the body."""
        self._body = model.joint_of >= 0
        self._asleep = np.zeros(len(keys), bool)
        self._slow = np.zeros(len(keys), int)
        self._woken = np.zeros(len(keys), bool)
        self._held = np.zeros(0, np.int64)
        self._geoms = np.flatnonzero(self._place_of < len(keys))
        hinged = self._place_of[self._geoms] >= len(model.movable)
        self._meets = np.where(hinged, HINGED["conaffinity"], MOVABLE["conaffinity"])
        self._let_meet()

    def lull(self, data: Any) -> None:
        """Put every object to sleep that does not move."""
        # Exactly 0: what topples or rises slowly would hang in mid-air.
        self._asleep |= self._speeds(data) == 0.0
        self._held = self._dofs[self._asleep].ravel()
        self._let_meet()

    def held(self) -> NDArray[np.int64]:
        """Return the velocity addresses of objects that must not fall in this step.

        These are the sleepers, and the objects that woke in this step: when contacts were searched, they were still
        asleep, so the contacts with their supports are missing.
        """
        return self._held

    def arrange(self, data: Any, geoms: NDArray[np.int32], gaps: Array) -> None:
        """Wake objects near an awake object or the body, and let still objects sleep.

        geoms: (contacts, 2). gaps: (contacts,) their distances, metres.
        """
        if self._undisturbed(data, geoms, gaps):
            return
        before = self._asleep
        places, body = self._place_of[geoms], self._body[geoms]
        others = self._active(places, body)[:, ::-1]
        stirred = places[others & (gaps <= NEAR)[:, None]]
        self._stir(stirred[stirred < len(self._asleep)])
        self._rest(data)
        self._woken = before & ~self._asleep
        self._held = self._dofs[self._asleep | self._woken].ravel()
        if (before != self._asleep).any():
            self._let_meet()

    def _undisturbed(self, data: Any, geoms: NDArray[np.int32], gaps: Array) -> bool:
        """Tell whether everything sleeps and goes on sleeping: nothing has moved a sleeper, and nothing is near one."""
        if not self._asleep.all() or self._woken.any():
            return False
        return not disturbed(geoms, gaps, self._place_of, len(self._asleep), data.qvel, self._held)

    def _active(self, places: NDArray[np.int64], body: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (contacts, 2) whether each of the two sides belongs to the body or to an awake object."""
        # One past the last object stands for what is fixed, which is never awake.
        return np.asarray(body | np.append(~self._asleep, False)[places])

    def _stir(self, places: NDArray[np.int64]) -> None:
        # A copy, because arrange compares it with what was before.
        self._asleep = self._asleep.copy()
        self._asleep[places], self._slow[places] = False, 0

    def _rest(self, data: Any) -> None:
        speeds = self._speeds(data)
        self._slow = np.where(speeds < _STILL, self._slow + 1, 0)
        self._asleep = (self._asleep & (speeds < _STILL)) | (self._slow > _PATIENCE)
        data.qvel[self._dofs[self._asleep]] = 0.0

    def _let_meet(self) -> None:
        """Exclude sleepers from contacts with fixed objects and with one another, and their joints from friction and
        limits."""
        asleep = self._asleep[self._place_of[self._geoms]]
        self._affinity[self._geoms] = np.where(asleep, 0, self._meets)
        hung = self._asleep[len(self._asleep) - len(self._hinges) :]
        # Each would be a constraint of every step; without, doors that nothing touches cost 3 % of it.
        self._model.jnt_limited[self._hinges] = ~hung
        self._model.dof_frictionloss[self._hinge_dofs] = np.where(hung, 0.0, self._frictions)

    def _speeds(self, data: Any) -> Array:
        return np.asarray(np.abs(data.qvel[self._dofs]).max(axis=1, initial=0.0))
