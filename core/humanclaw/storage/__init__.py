"""Files on disk: written whole or not at all, a bounded cache, pictures as bytes."""

from typing import TYPE_CHECKING

from humanclaw.doors import door

if TYPE_CHECKING:
    from humanclaw.storage.cache import VARIABLE as VARIABLE, Cache as Cache
    from humanclaw.storage.files import within as within, write_atomically as write_atomically
    from humanclaw.storage.pictures import from_jpeg as from_jpeg, gif as gif, jpeg as jpeg

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = door(__name__)
