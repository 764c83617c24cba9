"""A folder tree in the format of AMASS, made by a program: synthesised walks, turns and pauses of several subjects."""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion, Plugins
from humanclaw.body import matrix_from_vector, rest_pose, vector_from_matrix
from humanclaw_train.synthesis.commands import Commands, Trained, trained
from humanclaw_train.synthesis.profiles import CHANNELS, HARMONICS, Profiles, channel, channels
from humanclaw_train.synthesis.synthesize import play

_UPRIGHT = matrix_from_vector(np.array([-np.pi / 2, 0.0, 0.0]))
"""From AMASS's Z up to our Y up."""
_WALK = [("stop", {}), *[("walk", {"z": 0.55})] * 8, *[("stop", {})] * 6]
_STROLL = (
    [("walk", {"z": 0.4, "yaw": 0.2})] * 4 + [("turn_in_place", {"yaw": 0.9})] * 2 + [("side_step", {"x": 0.3})] * 2
)


def swinging() -> Profiles:
    """Return profiles of a walker that swings the arms, turns the pelvis and sways slightly when idle."""
    stance = channels(rest_pose(4))[0]
    gait = np.zeros((2, 1 + 2 * HARMONICS, CHANNELS))
    gait[:, 0] = stance
    gait[:, 2, 2] = 0.06
    gait[:, 1, channel("left_shoulder", 1)] = gait[:, 1, channel("right_shoulder", 1)] = 0.3
    sway = 0.02 * np.sin(np.linspace(0, 20, 300))[:, None] * np.eye(CHANNELS)[channel("spine2", 2)]
    return Profiles(gait, stance, sway)


@cache
def trained_skills() -> dict[str, Trained]:
    """Return the installed skills that have a recipe, by name. Finding them takes half a second."""
    return {skill.name: skill for skill in trained(Plugins.discover())}


def synthesize(commands: list[tuple[Trained, dict[str, float]]], seed: int) -> Motion:
    """Return one such body that stands for 5 frames and then carries out commands of 15 frames each."""
    calls = [Commands.of([skill], np.zeros(1, int), _values(skill, given)) for skill, given in commands]
    root, rotations, _ = play(swinging(), calls, np.random.default_rng(seed))
    return Motion(root[0], rotations[0])


def _values(skill: Trained, given: dict[str, float]) -> NDArray[np.floating]:
    return np.array([[given.get(parameter.name, 0.0) for parameter in skill.declaration.parameters]])


def write_amass(folder: Path, subjects: int = 3) -> Path:
    """Write `folder/STUDIO/SUBJECT/CLIP_poses.npz`, two clips a subject, and each subject's shape.npz, as AMASS has."""
    skills = trained_skills()
    for subject in range(subjects):
        here = folder / "STUDIO" / f"{subject:02d}"
        here.mkdir(parents=True)
        np.savez(here / "shape.npz", gender="neutral", betas=np.zeros(16))
        for name, calls in {"walk": _WALK, "stroll": _STROLL}.items():
            motion = synthesize([(skills[skill], given) for skill, given in calls], subject)
            write_clip(here / f"{name}_poses.npz", motion)
    return folder


def write_clip(file: Path, motion: Motion, hertz: int = 120) -> None:
    """Write a motion as AMASS does: Z up, rotation vectors of 52 joints, at the rate of the studio's cameras."""
    poses, root = _faster(motion.rotations, hertz // 30), _faster(motion.root, hertz // 30)
    poses[:, 0] = vector_from_matrix(_UPRIGHT.T @ matrix_from_vector(poses[:, 0]))
    hands = np.zeros((len(poses), 52 - 22, 3))
    whole = np.concatenate([poses[:, :22], hands], 1).reshape(len(poses), -1)
    shape = {"gender": "neutral", "betas": np.zeros(16), "dmpls": np.zeros((len(poses), 8))}
    np.savez(file, poses=whole, trans=root @ _UPRIGHT, mocap_framerate=float(hertz), **shape)


def _faster(values: NDArray[np.floating], times: int) -> NDArray[np.floating]:
    """Interpolate between the frames (T, ...)."""
    at = np.linspace(0, len(values) - 1, times * (len(values) - 1) + 1)
    low = np.minimum(at.astype(int), len(values) - 2)
    part = (at - low).reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray((1 - part) * values[low] + part * values[low + 1])
