"""Furniture as other people publish it: what a collection models, before any of it is read."""

from humanclaw_houses.importers.opening import open_collection
from humanclaw_houses.importers.source_models import Collection, SourceModel

__all__ = ["Collection", "SourceModel", "open_collection"]
