"""Plugins, their items, and a user's choice among them. Light, so that commands can parse it before plugins load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from packaging.utils import canonicalize_name

from humanclaw.plugins import hookspecs


@dataclass(frozen=True)
class Choice:
    """Which of the installed plugins and skills to use.

    An owner is a distribution, with or without `humanclaw-`, or the name of a plugin file without .py.
    """

    without: tuple[str, ...] = ()
    """owner, owner:name, or the name of a skill: left out."""
    skills: tuple[str, ...] = ()
    """name or owner:name: the only skills that can be called; empty for all."""

    def names(self, item: Registration) -> bool:
        """Whether `skills` names an item with its owner, which sets it before other items of its name."""
        return any(":" in text and means(text, item) for text in self.skills)

    def drops(self, item: Registration, kind: str) -> bool:
        """Whether an item of a plugin is left out."""
        return any(drops(text, item, kind) for text in self.without)


@dataclass(frozen=True)
class PluginInfo:
    """A plugin as `humanclaw plugins` lists it."""

    name: str
    """Its distribution, or its file without .py: the owner of its registrations."""
    version: str
    origin: str
    """The distribution or file it came from."""
    provides: tuple[str, ...] = ()
    error: str = ""
    """Why it is disabled; empty if it is in use."""
    disabled: Mapping[str, str] = field(default_factory=dict)
    """Skills that were rejected, by name, with the reason. The others are in use."""
    duplicates: tuple[str, ...] = ()
    """Its items that give way to another plugin's of the same name, each with both owners."""
    notes: tuple[str, ...] = ()
    """The deprecated names that it uses, and their replacements."""


@dataclass(frozen=True)
class Registration:
    """An item registered under a name: a skill, a factory, or whatever else a hook takes."""

    name: str
    owner: str
    value: Any
    description: str = ""


def drops(text: str, item: Registration, kind: str) -> bool:
    """Whether a text of `without` leaves out an item of a plugin that stays."""
    return means(text, item) if ":" in text else kind == "skills" and text == item.name


def means(text: str, item: Registration) -> bool:
    """Whether owner or owner:name refers to an item."""
    owner, _, name = text.partition(":")
    return is_owner(owner, item.owner) and name in ("", item.name)


def is_owner(text: str, owner: str) -> bool:
    """Whether a text names a plugin. Case, dashes and the prefix humanclaw- make no difference."""
    names = canonicalize_name(text), canonicalize_name(f"{hookspecs.PROJECT}-{text}")
    return canonicalize_name(owner.partition("/")[0]) in names or text == owner
