"""Arrays that wait on disk, so that they take no memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from tempfile import TemporaryFile
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


class Overflow:
    """A temporary file without a name, which goes with the process."""

    def __init__(self) -> None:
        self._file: Any = None

    def put(self, arrays: Mapping[str, _Array]) -> Mapping[str, _Array]:
        """Return the same arrays by name, read from the file each time; those for which it has no room as they are."""
        data = b"".join(np.ascontiguousarray(array, float).tobytes() for array in arrays.values())
        try:
            self._file = self._file or TemporaryFile(buffering=0)  # noqa: SIM115
            at = self._file.seek(0, 2)
            if self._file.write(data) < len(data):
                return arrays
        except OSError:
            return arrays
        return _Away(self._file, at, {name: array.shape for name, array in arrays.items()})

    def close(self) -> None:
        """Remove the file."""
        if self._file:
            self._file.close()


class _Away(Mapping[str, _Array]):
    """Arrays that lie one after the other in a file."""

    def __init__(self, file: Any, at: int, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._file: Final = file
        ends = np.cumsum([at, *(8 * int(np.prod(shape)) for shape in shapes.values())]).tolist()
        self._places = {name: (end, shape) for end, (name, shape) in zip(ends, shapes.items(), strict=False)}

    def __getitem__(self, name: str) -> _Array:
        at, shape = self._places[name]
        self._file.seek(at)
        return np.frombuffer(self._file.read(8 * int(np.prod(shape)))).reshape(shape)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)
