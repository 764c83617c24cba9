"""Public names that other packages import from here."""

from humanclaw_scripted.oracle import OracleAgent
from humanclaw_scripted.truth import in_view

__all__ = ["OracleAgent", "in_view"]
