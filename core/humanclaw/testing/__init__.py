"""Tools for those who write skills and harnesses: contract checks and a scripted model server."""

from humanclaw.testing.contract import check_skill

__all__ = ["check_skill"]
