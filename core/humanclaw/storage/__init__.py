"""Files on disk: written whole or not at all, a bounded cache, pictures as bytes."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.storage.archives import DAMAGED as DAMAGED
    from humanclaw.storage.cache import VARIABLE as VARIABLE, Cache as Cache, source_digest as source_digest
    from humanclaw.storage.files import (
        Folder as Folder,
        lacking as lacking,
        read_file as read_file,
        within as within,
        write_atomically as write_atomically,
        write_result as write_result,
        writing as writing,
    )
    from humanclaw.storage.pictures import (
        from_jpeg as from_jpeg,
        gif as gif,
        jpeg as jpeg,
        save_picture as save_picture,
    )

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
