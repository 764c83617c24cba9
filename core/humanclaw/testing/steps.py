"""The parts of a step that tests look at one by one: is a decision one legal call, and what its chunks touched."""

from humanclaw._calls import check
from humanclaw._recorder import contacts, touches

__all__ = ["check", "contacts", "touches"]
