"""What an episode was played with: all that its numbers depend on besides the answers of the agent."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from humanclaw.cli import counted
from humanclaw.records import EpisodeRecord

Conditions = Mapping[str, str]
"""Value by name. The backends have plain names, such as simulator; other names begin with a kind: 'skill walk'."""
CHOICES_OF_AGENTS: Final = ("agent", "option", "verifier")
"""Kinds that belong to one agent, so that two agents usually differ in them."""
_SHORT: Final = 8
"""Characters of a digest that are shown."""
_LONGEST: Final = 60
"""Longest value that is shown whole."""
_MISSING: Final = {"limit": "none", "choice": "none"}


def conditions_of(record: EpisodeRecord) -> Conditions:
    """Return the conditions of an episode: backends, senses, limits, skills, their versions, and the agents'
    settings."""
    settings = record.settings
    mine, body = settings.get("agent", {}), settings.get("body", {})
    limits = {name: most for name, most in settings.get("limits", {}).items() if not name.startswith("run.")}
    kinds: Mapping[str, Mapping[str, Any]] = {
        "": body,
        "limit": limits,
        "choice": settings.get("plugins", {}),
        "skill": {name: info.digest[:_SHORT] or "unknown" for name, info in record.skills.items()},
        "weight": {name: digest[:_SHORT] for name, digest in record.weights.items()},
        "version": record.versions,
        "verifier": settings.get("verifier", {}),
        "agent": mine,
        "option": {name: value for name, value in record.options.items() if name not in {*mine, *body}},
    }
    return {f"{kind} {name}".strip(): _text(value) for kind, values in kinds.items() for name, value in values.items()}


def _text(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, sort_keys=True)
    return text if len(text) <= _LONGEST else f"{text[:20]}... ({digest([text])})"


def digest(texts: Iterable[str]) -> str:
    """Return a short digest of texts."""
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:_SHORT]


def of_world(conditions: Conditions) -> Conditions:
    """Return the conditions that do not belong to an agent or a verifier."""
    return {name: value for name, value in sorted(conditions.items()) if _kind(name) not in CHOICES_OF_AGENTS}


def differences(a: Conditions, b: Conditions) -> tuple[str, ...]:
    """Return what differs, such as 'profile (default and paper)'."""
    names = dict.fromkeys((*a, *b))
    return tuple(f"{name} ({_of(a, name)} and {_of(b, name)})" for name in names if a.get(name) != b.get(name))


def labels(rows: Sequence[tuple[str, Conditions]]) -> list[str]:
    """Return the label of each row, empty if nothing differs: the values in which the rows differ.

    rows: name of the agent, and conditions. Settings of agent and verifier tell apart rows of one name alone.
    """
    return ["".join(f", {text}" for text in _label(of, _differing(name, rows))) for name, of in rows]


def _differing(agent: str, rows: Sequence[tuple[str, Conditions]]) -> list[str]:
    """Return the names of the conditions that tell a row of this agent from others."""
    names = dict.fromkeys(name for _, conditions in rows for name in conditions)
    return [
        name for name in names
        if len({of.get(name) for other, of in rows if other == agent or _kind(name) not in CHOICES_OF_AGENTS}) > 1
    ]  # fmt: skip


def _label(conditions: Conditions, names: Sequence[str]) -> Iterator[str]:
    """Yield a text for each kind: the value if one differs, else a digest of all."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for name in names:
        kinds[_kind(name) or name].append(name)
    for kind, mine in kinds.items():
        values = [_of(conditions, name) for name in mine]
        if len(mine) > 1:
            yield f"{kind}s {digest(values)}"
        else:
            yield _short(mine[0], values[0])


def summary(conditions: Conditions) -> str:
    """Return the conditions in a line: kinds with many entries as their number and a digest."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for name in conditions:
        kinds[_kind(name)].append(name)
    parts = [_short(name, conditions[name]) for name in kinds.pop("", [])]
    parts += [f"{name} {conditions[name]}" for kind in ("limit", "choice") for name in kinds.pop(kind, [])]
    parts += [] if any(name.startswith("limit ") for name in conditions) else ["no limits"]
    for kind, names in kinds.items():
        content = sorted(f"{name} {conditions[name]}" for name in names)
        parts.append(f"{counted(len(names), kind)} ({digest(content)})")
    return ", ".join(parts)


def _short(name: str, value: str) -> str:
    """Return a condition as text. A simulator has a name that needs no other word."""
    return value if name == "simulator" and value != "unknown" else f"{name} {value}"


def _of(conditions: Conditions, name: str) -> str:
    return conditions.get(name, _MISSING.get(_kind(name), "unknown"))


def _kind(name: str) -> str:
    """Return the kind of a condition; empty for a backend."""
    return name.partition(" ")[0] if " " in name else ""
