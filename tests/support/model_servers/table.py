"""The replies of replies.toml, and what the harness makes of each, as a list for the docs."""

from __future__ import annotations

import functools
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Self

from model_servers import dialects
from model_servers.openai_server import OpenAIServer, Reply

FILE = Path(__file__).with_name("replies.toml")
OUTCOMES: Final = {
    "executed": "executed",
    "told": "the model reads why not",
    "asked otherwise": "left out of later requests",
    "shortened": "fewer past steps",
    "retried": "tried again, then `infra_error`",
    "mended by the user": "an error with a remedy, exit code 2",
}
"""What may become of a reply, in plain words."""
SEVERAL: Final = 3
"""Providers that send a reply which the docs list: fewer are as many kinds again, which nobody reads."""


@dataclass(frozen=True)
class Row:
    """A reply of a provider, and what becomes of it. The head of replies.toml explains the fields."""

    provider: str
    when: str
    model: str
    server: type[OpenAIServer]
    reply: Reply
    then: str
    source: str
    says: str = ""
    without: str = ""
    thoughts: str = ""
    wait: float = 0.0
    tokens: tuple[int, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, provider: str, about: dict[str, Any], row: dict[str, Any]) -> Self:
        body = row.get("body") or _filled(about["envelope"], row["answer"], row["end"], about["usage"])
        reply = Reply(body, row.get("status", 200), row.get("headers", {}))
        own = {key: row[key] for key in ("says", "without", "thoughts", "wait", "options") if key in row}
        given = {key: row.get(key) or about[key] for key in ("model", "source")}
        server = getattr(dialects, about["server"], OpenAIServer)
        tokens = tuple(row.get("tokens", ()))
        return cls(provider, row["when"], server=server, reply=reply, then=row["then"], tokens=tokens, **given, **own)

    def __str__(self) -> str:
        return f"{self.provider}: {self.when}"


@functools.cache
def providers() -> dict[str, dict[str, Any]]:
    return tomllib.loads(FILE.read_text())


def rows() -> list[Row]:
    return [Row.of(name, about, row) for name, about in providers().items() for row in about["replies"]]


def a_call(provider: str) -> Row:
    """Return the row of the provider's usual answer."""
    return next(row for row in rows() if (row.provider, row.when) == (provider, "a call"))


def markdown() -> str:
    """Return a list for the docs: what becomes of the replies that several providers send, and how many send each."""
    senders = Counter((row.then, row.when) for row in rows())
    common = {reply: n for reply, n in senders.items() if n >= SEVERAL}
    lines = [
        f"* {words}: " + ", ".join(f"{when} ({n})" for (then, when), n in common.items() if then == outcome)
        for outcome, words in OUTCOMES.items()
    ]
    return "\n".join(lines) + "\n"


def _filled(envelope: str, answer: str, end: str, usage: str) -> str:
    return envelope.replace("ANSWER", answer).replace("END", end).replace("USAGE", usage)


if __name__ == "__main__":
    print(markdown(), end="")
