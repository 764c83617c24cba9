"""DESCRIPTION"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Verifier
    from humanclaw.hookspecs import Register, VerifierFactory

__version__ = "0.1.0"


@hookimpl
def humanclaw_verifiers(register: Register[VerifierFactory]) -> None:
    register("example", _verifier, "lets nobody stop before the third step")


def _verifier(options: Mapping[str, Any]) -> Verifier:
    from humanclaw_example.verifier import ExampleVerifier

    return ExampleVerifier()
