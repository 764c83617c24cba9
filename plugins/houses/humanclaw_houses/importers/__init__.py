"""Read published furniture collections: list their models before any model file is read."""

from humanclaw_houses.importers.opening import open_collection
from humanclaw_houses.importers.source_models import Collection, SourceModel

__all__ = ["Collection", "SourceModel", "open_collection"]
