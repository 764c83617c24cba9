"""Open the collections at a path, whatever their kind."""

from __future__ import annotations

from pathlib import Path

from humanclaw import HumanclawError
from humanclaw_houses.importers import folder, sweethome
from humanclaw_houses.importers.source_models import Collection

EXPECTED = (
    "Give a Sweet Home 3D library (NAME.sh3f, or a folder of them, or one unpacked with its "
    f"{sweethome.CATALOGUE}), or a folder of GLB or OBJ models."
)


def open_collection(source: Path, name: str = "", metadata: folder.FolderMetadata | None = None) -> list[Collection]:
    """Return the collections at a path. Raises HumanclawError if there is nothing to import."""
    if not source.exists():
        raise HumanclawError(f"there is nothing at {source}.", EXPECTED)
    if source.is_file():
        if source.suffix.lower() not in (".sh3f", ".zip"):
            raise HumanclawError(f"{source} is neither a Sweet Home 3D library nor a folder.", EXPECTED)
        return [sweethome.open_zip(source, name)]
    libraries = sorted(source.glob("*.sh3f"))
    if libraries:
        return [sweethome.open_zip(path, f"{name}-{path.stem}" if name else "") for path in libraries]
    if (source / sweethome.CATALOGUE).is_file():
        return [sweethome.open_folder(source, name)]
    collection = folder.open_folder(source, name, metadata or folder.FolderMetadata())
    if not collection.models:
        raise HumanclawError(f"there is no model in {source}.", EXPECTED)
    return [collection]
