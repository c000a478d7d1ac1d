"""Compiled code on disk: numba's index and data files, each behind a checksum, in names that no other process writes.

Numba reads what is there as it is: a torn file is a traceback of pickle, and one with a wrong byte is run. Here a damaged
file is thrown away and its function compiled again. These change numba's insides; `compiling` does without this module
where it does not load.
"""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from bug_gym.log import logger, warn_once

DIGEST = hashlib.sha256().digest_size


class KeptFiles(IndexDataCacheFile):
    """The files of one function; a file is a checksum of what follows, and that.

    Args:
        files: numba's own, of the same function.
        stamp: what tells today's sources from older ones, beside numba's own stamp of the function's file.
        process: what no other process has in the names of its files. Numba numbers the files of a function's signatures
            by what its index holds: of two processes that compile different signatures at once, one could write the
            other's file, and the index then give that code to the wrong types.

    Raises:
        AttributeError: this numba keeps its files in another way.
    """

    def __init__(self, files: IndexDataCacheFile, stamp: str, process: str) -> None:
        self._cache_path, self._version = files._cache_path, files._version
        self._index_name = files._index_name.replace(".nbi", ".kept.nbi")  # numba's own index has no checksum
        self._index_path = str(Path(self._cache_path, self._index_name))
        self._source_stamp = (files._source_stamp, stamp)
        if ".{number" not in files._data_name_pattern:
            raise AttributeError("the names of data files are made in another way")
        self._data_name_pattern = files._data_name_pattern.replace(".{number", f".{process}.{{number")

    def take_name(self, old: str, new: str) -> None:
        """Take another process's place in the names of files to write."""
        self._data_name_pattern = self._data_name_pattern.replace(old, new)

    def holds(self, code: Any, types: tuple[Any, ...] | None) -> bool:
        """Whether there is whole code.

        Args:
            code: the machine and the bytecode, the last two parts of numba's key.
            types: the signature, its first part; None: any.
        """
        kept = [
            name
            for (signature, *rest), name in self._load_index().items()
            if tuple(rest) == tuple(code) and types in (None, signature)
        ]
        return any(self._content(Path(self._data_path(name))) is not None for name in kept)

    def _load_index(self) -> dict[Any, str]:
        content = self._content(Path(self._index_path))
        if content is None:
            return {}
        version, stamp, overloads = pickle.loads(content)
        # The last part is unpickled only where this numba wrote it: another one's types may not be there.
        fits = (version, stamp) == (self._version, self._source_stamp)
        return dict(pickle.loads(overloads)) if fits else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        content = pickle.dumps((self._version, self._source_stamp, self._dump(overloads)))
        self._write(self._index_path, content)

    def _load_data(self, name: str) -> Any:
        content = self._content(Path(self._data_path(name)))
        return None if content is None else pickle.loads(content)

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(content).digest() + content)

    def _content(self, path: Path) -> bytes | None:
        """What stands behind the checksum; None where there is no such file, or it was damaged and is gone now."""
        try:
            whole = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            warn_once(f"compiled code in {path.parent} cannot be read ({error.strerror}): it is compiled again")
            return None
        digest, content = whole[:DIGEST], whole[DIGEST:]
        if hashlib.sha256(content).digest() == digest:
            return content
        logger.warning("%s is damaged: thrown away, and compiled again", path)
        _throw_away(path)
        return None


class KeptCache(FunctionCache):
    """Numba's cache of one function, in files of ours.

    Args:
        function: what is compiled.
        stamp: see KeptFiles.
        process: see KeptFiles.

    Raises:
        RuntimeError: there is no place for files.
        AttributeError: this numba keeps its files in another way.
    """

    def __init__(self, function: Any, stamp: str, process: str) -> None:
        super().__init__(function)
        self._cache_file: KeptFiles = KeptFiles(self._cache_file, stamp, process)

    @property
    def files(self) -> KeptFiles:
        """Where the code is."""
        return self._cache_file

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep code; where there is no room for it or no leave to write, one line says so, and it serves unkept."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            warn_once(f"compiled code cannot be kept in {self.cache_path}: {error.strerror}")


def _throw_away(path: Path) -> None:
    try:
        path.unlink()
    except OSError:  # not ours to remove: it is written over, or read and found damaged again
        return
