"""What plugins keep on disk: files written whole or not at all, a bounded cache, scenes and pictures as bytes."""

from humanclaw._cache import VARIABLE, Cache
from humanclaw._files import within, write_atomically
from humanclaw._pictures import gif, jpeg
from humanclaw._scene_file import pack_scene, unpack_scene

__all__ = ["VARIABLE", "Cache", "gif", "jpeg", "pack_scene", "unpack_scene", "within", "write_atomically"]
