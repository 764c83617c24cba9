"""The settings of a run: filled in before it begins, written to run.json, and held to when it continues."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import humanclaw
from humanclaw import Choice, EpisodeSpec, Plugins, RecordError
from humanclaw.cli import check_options
from humanclaw.plugins import PluginInfo, noun, own, package_in
from humanclaw.storage import Folder, writing
from humanclaw_bench.isolation.agents import PROCESS
from humanclaw_bench.verification import MANIFEST, read_manifest, split_digest
from humanclaw_bench.worker import Job

FORMAT: Final = 1
"""Of run.json. Raise it when an older reader would take a field for something else."""
UNTOLD: Final = ("files", "limits", "choice", "names", "in_process", "apart", "absent", "stop_after")
"""Fields of a job that run.json tells otherwise, or that follow from others."""


def seeded(job: Job, out: Path) -> Job:
    """Draw the seed of a new run if the job has none. A run that continues keeps its own."""
    if job.seed is not None:
        return job
    if Folder(out).has(MANIFEST):
        return replace(job, seed=read_manifest(out).content.get("seed"))
    return replace(job, seed=secrets.randbits(53))  # Readers of JSON lose the digits of more.


def introduced(job: Job, plugins: Plugins) -> Job:
    """Fill in the names of backends, agent and verifier, and where agent and verifier play.

    Raises HumanclawError if the job names something unknown, or options that neither agent nor verifier takes.
    """
    made = {"agents": plugins.make("agents", job.agent, job.options)}
    made["verifiers"] = plugins.make("verifiers", job.verifier, job.options) if job.verifier else None
    check_options(job.options, job.agent, made["agents"], made["verifiers"])
    names = {}
    for kind, agent in made.items():
        with contextlib.suppress(Exception):  # A broken name becomes an error of the episode.
            names[kind] = str(getattr(agent, "name", ""))
    # Those who know everything already play beside the body; their records say that they are privileged.
    open_to = [kind for kind, agent in made.items() if agent and not getattr(agent, "privileged", False)]
    apart = {} if job.in_process else dict.fromkeys(open_to, PROCESS)
    asked = {"agents": job.agent, "verifiers": job.verifier}
    needed = {f"{noun(kind)} {name.rpartition(':')[2]}" for kind, name in asked.items() if kind not in apart}
    away = [info for info in plugins.infos if apart and not needed & {*info.provides}]
    absent = tuple(_told_as(info) for info in away if _only_decides(info, plugins, job.choice))
    return replace(job, backends=job.backends.chosen(plugins), names=names, apart=apart, absent=absent)


def _only_decides(info: PluginInfo, plugins: Plugins, choice: Choice) -> bool:
    """Whether a plugin of others brings nothing but agents and verifiers, observers included."""
    named = [text.partition(":")[0] for text in choice.skills]
    if info.error or info.origin in own() or info.name in named:
        return False
    return plugins.hooks(info.name) <= {"humanclaw_agents", "humanclaw_verifiers"}


def _told_as(info: PluginInfo) -> str:
    """Return what names a plugin in Job.absent: its path if it is a file, because two files may share a name."""
    return info.origin if os.sep in info.origin or info.origin.endswith(".py") else info.name


def manifest(specs: Sequence[EpisodeSpec], job: Job, plugins: Plugins) -> dict[str, Any]:
    """Return all settings that must be equal in all sessions of a run.

    Raises HumanclawError if the job names something unknown.
    """
    base: str = plugins.make("motion_generators", job.backends.generator, profile=job.backends.profile).digest
    files = {skill.name: skill.adapter for skill in plugins.skills.values() if skill.trained and skill.adapter}
    adapters = {name: _digest(path.read_bytes()) for name, path in files.items()}
    unusual = {
        "in process": job.in_process,
        "choice": asdict(job.choice) if job.choice != Choice() else None,
    }
    return {
        "format": FORMAT,
        "episodes": len(specs),
        "split": split_digest(specs),
        **{key: value for key, value in asdict(job).items() if key not in UNTOLD},
        "limits": {name: most for name, most in job.limits.items() if not name.startswith("run.")},
        "versions": _versions(specs, job, plugins),
        "plugin files": {path.name: _digest_of(path) for path in map(package_in, map(Path, job.files))},
        "weights": {"base": base} | adapters,
        **{key: value for key, value in unusual.items() if value},
    }


def _versions(specs: Sequence[EpisodeSpec], job: Job, plugins: Plugins) -> dict[str, str]:
    """Return the versions of humanclaw and of the distributions of the run's skills, backends, scenes and agents."""
    backends = job.backends
    used = {
        f"{noun('simulators')} {backends.simulator}",
        f"{noun('renderers')} {backends.renderer}",
        f"{noun('motion_generators')} {backends.generator}",
        f"{noun('agents')} {job.agent}",
        f"{noun('verifiers')} {job.verifier}",
        *(f"{noun('scenes')} {spec.scene.partition(':')[0]}" for spec in specs),
        *(f"skill {name}" for name in plugins.skills),
    }
    versions = {info.origin: info.version for info in plugins.infos if info.version and used & set(info.provides)}
    return {"humanclaw": humanclaw.__version__} | versions


def played_with_another(run: Path, file: Path) -> bool:
    """Tell whether a run was played with plugin files, and a file is none of these as they were then."""
    if MANIFEST not in Folder(run).names():
        return False
    played = str(read_manifest(run).content.get("plugin files") or "")  # A foreign run.json may hold anything.
    return bool(played) and _digest_of(file) not in played


def _digest_of(plugin: Path) -> str:
    """Return the digest of a plugin's file, or of its package's names and contents but for caches."""
    if not plugin.is_dir():
        return _digest(plugin.read_bytes())
    names = (path.relative_to(plugin) for path in plugin.rglob("*") if path.is_file())
    kept = sorted(
        name.as_posix() for name in names if not any(part.startswith((".", "__pycache__")) for part in name.parts)
    )
    return _digest("".join(f"{name} {_digest((plugin / name).read_bytes())}\n" for name in kept).encode())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def agree(out: Path, wanted: dict[str, Any]) -> None:
    """Write run.json, or compare an earlier one with the wanted settings. Raises RecordError if they differ."""
    wanted = json.loads(json.dumps(wanted))
    if not Folder(out).has(MANIFEST):
        with writing(out):
            Folder(out).write(MANIFEST, json.dumps(wanted, indent=1).encode())
        return
    recorded = read_manifest(out).content
    differing = sorted(key for key in wanted.keys() | recorded.keys() if wanted.get(key) != recorded.get(key))
    if differing:
        changes = "; ".join(_difference(key, recorded.get(key), wanted.get(key)) for key in differing)
        raise RecordError(f"{out} holds a run with other settings: {changes}.", "Name another folder with --out.")


def _difference(key: str, recorded: Any, wanted: Any) -> str:
    if isinstance(recorded, dict) and isinstance(wanted, dict):
        inner = sorted(name for name in recorded.keys() | wanted.keys() if recorded.get(name) != wanted.get(name))
        return ", ".join(_difference(f"{key} {name}", recorded.get(name), wanted.get(name)) for name in inner)
    return f"{key} was {_short(recorded)} and is now {_short(wanted)}"


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    # A SHA-256, of which a dozen digits tell enough.
    return text[:12] if len(text) == 64 else text
