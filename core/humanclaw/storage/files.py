"""The one door to folders that may come from others: runs, records, submissions, caches, libraries of assets.

Below a folder no link is followed, only regular files are opened, no more than a bound is read, and a file is replaced
whole: no reader ever sees half of one, even after a power cut.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import stat
import threading
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import BinaryIO, Final, cast

from humanclaw.errors import RecordError

MIB: Final = 1 << 20
_DEEPEST: Final = 32
"""Maximum depth at which a folder is searched."""
_PLAIN: Final = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
"""Flags of every file. O_NONBLOCK: to open a pipe without a writer would take forever."""
_JUNCTION: Final = 0xA0000003
"""Tag of Windows' links to folders."""


@dataclass(frozen=True)
class Folder:
    """A folder and the files below it, by names relative to it such as "frames/0001.jpg".

    The methods raise OSError, with a sentence as strerror, for a link, for anything but a regular file, and for a name
    that leads out of the folder.
    """

    root: Path
    """The folder that the user named: links on the way to it are followed."""
    inside: str = ""
    """The folder's place below root: links there are refused."""

    @classmethod
    def of(cls, folder: Path | str | Folder) -> Folder:
        return folder if isinstance(folder, Folder) else cls(Path(folder))

    @property
    def path(self) -> Path:
        return self.root / self.inside

    def __truediv__(self, name: str) -> Folder:
        return Folder(self.root, (PurePath(self.inside) / name).as_posix())

    # -- reading -------------------------------------------------------------------------------------------------------
    @contextmanager
    def open(self, name: str, most: int) -> Iterator[BufferedReader]:
        """Open a file for reading. Raises OSError if it has more than `most` bytes."""
        path = self._at(name)
        with cast(BufferedReader, _opened(path, os.O_RDONLY)) as stream:
            if os.fstat(stream.fileno()).st_size > most:
                raise _error(path, errno.EFBIG, f"is larger than {most / MIB:g} MiB")
            yield stream

    def read(self, name: str, most: int) -> bytes:
        """Return the content of a file of at most `most` bytes."""
        with self.open(name, most) as stream:
            return stream.read(os.fstat(stream.fileno()).st_size)

    def digest(self, name: str, most: int) -> str:
        """Return the SHA-256 of a file of at most `most` bytes."""
        with self.open(name, most) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def status(self, name: str) -> os.stat_result | None:
        """Return size and times of a regular file; None for anything else, and if there is nothing."""
        with suppress(OSError):
            status = self._at(name).lstat()
            return status if stat.S_ISREG(status.st_mode) else None
        return None

    def has(self, name: str) -> bool:
        """Tell whether there is a regular file of that name."""
        return self.status(name) is not None

    def names(self, ending: str = "") -> list[str]:
        """Return the names in the folder that end so, sorted; none if there is no folder."""
        with suppress(FileNotFoundError):
            return sorted(name for name in os.listdir(self._held()) if name.endswith(ending))
        return []

    def statuses(self) -> dict[str, os.stat_result]:
        """Return size and times of each regular file in the folder; none if there is no folder."""
        statuses = {}
        with suppress(FileNotFoundError):
            for entry in os.scandir(self._held()):
                with suppress(FileNotFoundError):  # Another process may remove it meanwhile.
                    statuses[entry.name] = entry.stat(follow_symlinks=False)
        return {name: status for name, status in statuses.items() if stat.S_ISREG(status.st_mode)}

    def holding(self, name: str) -> list[Folder]:
        """Return each folder that holds a file of that name, this one and all below it, in order.

        Folders inside of such a folder are left out: a partner's record is a part of its episode's.
        """
        homes = []
        for home, folders, files in os.walk(self.path):
            below = PurePath(home).relative_to(self.path)
            homes += [below] if name in files else []
            folders[:] = folders if len(below.parts) < _DEEPEST and name not in files else []
        return [self / part.as_posix() if part.parts else self for part in sorted(homes)]

    # -- writing -------------------------------------------------------------------------------------------------------
    @contextmanager
    def replacing(self, name: str, settled: bool = True) -> Iterator[BinaryIO]:
        """Open a new file that takes the name when the block ends; if the block raises, the old one stays as it was.

        Readers see the old or the whole new file, even if several processes write at once. Missing folders below root
        are made. A link of that name is replaced, not followed. settled: whether the data are on disk after the block,
        for which it waits some milliseconds; otherwise after settle().
        """
        path = self._at(name, make=True)
        partial = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
        partial.unlink(missing_ok=True)  # A killed process of the same number may have left it.
        try:
            with _opened(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, "wb") as stream:
                yield stream
                stream.flush()
                if settled:
                    os.fsync(stream.fileno())
            os.replace(partial, path)
            if settled:
                _settle_names(path.parent)
        finally:
            partial.unlink(missing_ok=True)

    @contextmanager
    def placed(self, name: str) -> Iterator[Path]:
        """Yield a path for a program that writes the file itself; it takes the name when the block ends."""
        with TemporaryDirectory() as home, self.replacing(name) as stream:
            yield (path := Path(home, PurePath(name).name))
            with path.open("rb") as made:
                shutil.copyfileobj(made, stream)

    def write(self, name: str, data: bytes, settled: bool = True) -> None:
        """Write a file as replacing() does."""
        with self.replacing(name, settled) as stream:
            stream.write(data)

    def settle(self, names: Iterable[str]) -> None:
        """Wait until files of this folder itself, and their names, are on disk. The disk takes many at a time."""
        home = self._held()
        with ThreadPoolExecutor(8) as pool:
            for done in [pool.submit(_settle, home / name) for name in names]:
                done.result()
        _settle_names(home)

    def append(self, name: str) -> BinaryIO:
        """Open a file for reading and for adding to its end, unbuffered. Missing folders below root and the file are
        made.

        Raises OSError for a file with a second name elsewhere, since it would grow there too.
        """
        path = self._at(name, make=True)
        stream = _opened(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, "ab+", 0)
        if os.fstat(stream.fileno()).st_nlink > 1:
            stream.close()
            raise _error(path, errno.EMLINK, "has a second name elsewhere")
        return stream

    def remove(self, name: str) -> None:
        """Remove a file if it is there. Of a link, the link goes."""
        with suppress(FileNotFoundError):
            self._at(name).unlink()

    def touch(self, name: str) -> None:
        """Set the time of a file to now."""
        path = self._at(name)
        _opened(path, os.O_RDONLY).close()
        os.utime(path)

    def _at(self, name: str, make: bool = False) -> Path:
        """Return the path of a file, whose folder is one. make: make the folders below root."""
        *above, last = _parts(name) or [""]
        return self._held(above, make) / last

    def _held(self, below: Sequence[str] = (), make: bool = False) -> Path:
        """Return the path of a folder below this one, on the way to which is no link below root."""
        path = self.root
        for part in (*_parts(self.inside), *below):
            path /= part
            if make:
                with suppress(FileExistsError):
                    path.mkdir()
            _refuse_link(path)
        return path


def _error(path: Path, number: int, reason: str) -> OSError:
    return OSError(number, f"{path.name} {reason}", str(path))


def _refuse_link(path: Path) -> None:
    """Raise OSError for a link, in words. O_NOFOLLOW refuses a file that becomes one after this."""
    with suppress(FileNotFoundError):
        status = path.lstat()
        if stat.S_ISLNK(status.st_mode) or getattr(status, "st_reparse_tag", 0) == _JUNCTION:
            raise _error(path, errno.ELOOP, "is a link, which is not followed")


def _opened(path: Path, flags: int, mode: str = "rb", buffering: int = -1) -> BinaryIO:
    """Open a regular file."""
    _refuse_link(path)
    descriptor = os.open(path, flags | _PLAIN, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise _error(path, errno.EINVAL, "is no regular file")
    return cast(BinaryIO, os.fdopen(descriptor, mode, buffering))


def _settle(path: Path) -> None:
    with _opened(path, os.O_RDWR, "r+b") as stream:
        os.fsync(stream.fileno())


def _settle_names(folder: Path) -> None:
    """Wait until the names in a folder are on disk. Windows opens no folder."""
    if os.name != "nt":
        descriptor = os.open(folder, os.O_RDONLY)
        os.fsync(descriptor)
        os.close(descriptor)


def _parts(name: str) -> tuple[str, ...]:
    """Return the parts of a relative name. Raises OSError if it leads out of the folder, or no file can have it."""
    path = PurePath(name)
    try:
        if ".." in path.parts or path.anchor or b"\0" in os.fsencode(name):
            raise OSError(errno.EINVAL, f"{name!r:.200} leads out of the folder")
    except UnicodeEncodeError:
        raise OSError(errno.EINVAL, f"{name!r:.200} is no name of a file") from None
    return path.parts


def add_line(stream: BinaryIO, line: bytes) -> None:
    """Add a line to the end of a file of Folder.append(), whole or not at all. Raises OSError."""
    before = stream.seek(0, os.SEEK_END)
    try:
        if stream.write(line + b"\n") <= len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError:
        stream.truncate(before)
        raise


def state_of(status: os.stat_result | None) -> tuple[int, ...]:
    """Return inode, times and size of a file, by which a changed one is known; () if there is none.

    The first time can be put back, as copies do; the time of the last change of anything cannot.
    """
    return (status.st_ino, status.st_mtime_ns, status.st_ctime_ns, status.st_size) if status else ()


@contextmanager
def open_file(path: Path, most: int) -> Iterator[BufferedReader]:
    """Open a regular file of at most `most` bytes that the user named. Links are followed. Raises OSError."""
    if "\0" in str(path):  # For which Python raises ValueError.
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL), str(path))
    place = Path(os.path.realpath(path))
    with Folder(place.parent).open(place.name, most) as stream:
        yield stream


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a file as open_file() opens it."""
    with open_file(path, most) as stream:
        return stream.read()


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file that the user named, as Folder.replacing() does. Links are followed. Raises OSError."""
    place = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        path.write_bytes(data)  # A device or a pipe, such as /dev/stdout.
    else:
        Folder(place.parent).write(place.name, data)


def write_result(out: Path | None, folder: Path, name: str, data: bytes) -> Path:
    """Write a result of a command to the file that the user named, or else under that name in the folder that it read.

    Returns its path. Raises RecordError.
    """
    path = out or folder / name
    try:
        write_atomically(out, data) if out else Folder(folder).write(name, data)
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}.", "Name another file with --out.") from error
    return path


def within(folder: Path, name: str | Path) -> Path:
    """Return folder/name. Raises ValueError if the path, read as text, leads out of the folder. Links are not
    resolved."""
    home, path = os.path.abspath(folder), os.path.abspath(folder / name)
    if os.path.commonpath((home, path)) != home:
        raise ValueError(f"{str(name)!r} lies outside of {folder}")
    return Path(path)


def lacking(folder: Path, what: str, remedy: str) -> RecordError:
    """Return the error of a folder that does not exist, or that holds no such thing."""
    if not folder.is_dir():
        return RecordError(f"there is no folder {folder}.", remedy)
    return RecordError(f"there is no {what} in {folder if folder.name else folder.resolve()}.", remedy)


@contextmanager
def writing(folder: Path | Folder) -> Iterator[None]:
    """Turn an OSError, such as a full disk or a read-only folder, into a RecordError."""
    try:
        yield
    except OSError as error:
        reason = f"cannot write the record to {Folder.of(folder).path}: {error.strerror or error}."
        raise RecordError(reason, "Make room there, or name another folder with --out.") from error
