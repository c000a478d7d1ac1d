"""Episodes in a file as Minari lays them out in HDF5, written by HDF5's own calls in a fifth of the time.

Minari gives each array room to grow, a chunk and an index, and opens each episode again for what is said of it. Here an array
has its length, and small ones lie in their own header. Groups are of HDF5 1.10's form, which h5py has read since version 3.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Arrays: TypeAlias = Mapping[str, "NDArray[Any] | Arrays"]
"""Arrays by name, and groups of them."""

SMALL = 4096
"""Arrays of fewer bytes lie in their own header."""


class EpisodeFile:
    """A new file of episodes, to be used in a `with`.

    Nothing in it tells of the time, so that the same episodes give the same bytes.

    Args:
        path: of the file; what is there is lost.
    """

    def __init__(self, path: Path) -> None:
        import h5py

        self._h5 = h5py
        self._path = path
        self._count = 0
        self._types: dict[np.dtype[Any], Any] = {}
        self._spaces: dict[tuple[int, ...], Any] = {(): h5py.h5s.create(h5py.h5s.SCALAR)}
        self._in_group = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
        self._large = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        self._large.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        self._small = self._large.copy()
        self._small.set_layout(h5py.h5d.COMPACT)
        for properties in (self._in_group, self._large, self._small):
            properties.set_obj_track_times(False)

    def __enter__(self) -> EpisodeFile:
        h5f, h5p = self._h5.h5f, self._h5.h5p
        access = h5p.create(h5p.FILE_ACCESS)
        access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
        made = h5p.create(h5p.FILE_CREATE)
        made.set_obj_track_times(False)
        made.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)  # episodes in their order
        self._file = h5f.create(os.fsencode(self._path), h5f.ACC_TRUNC, made, access)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, told: Mapping[str, int | str], arrays: Arrays) -> None:
        """Add an episode.

        Args:
            told: what is said of it, beside its number.
            arrays: what it is made of.
        """
        group = self._group(self._file, f"episode_{self._count}")
        for name, value in {"id": self._count, **told}.items():
            self._tell(group, name, value)
        self._write(group, arrays)
        self._count += 1

    def _group(self, at: Any, name: str) -> Any:
        return self._h5.h5g.create(at, name.encode(), gcpl=self._in_group)

    def _write(self, at: Any, arrays: Arrays) -> None:
        for name, values in arrays.items():
            if isinstance(values, Mapping):
                self._write(self._group(at, name), values)
                continue
            kind = self._type(values.dtype)
            properties = self._small if values.nbytes < SMALL else self._large
            there = self._h5.h5d.create(at, name.encode(), kind, self._space(values.shape), properties)
            there.write(self._h5.h5s.ALL, self._h5.h5s.ALL, np.ascontiguousarray(values), kind)

    def _tell(self, at: Any, name: str, value: int | str) -> None:
        """Say something of an episode, text as h5py writes it: of any length, in UTF-8."""
        is_text = isinstance(value, str)
        told = np.array(value, dtype=self._h5.string_dtype() if is_text else np.int64)
        self._h5.h5a.create(at, name.encode(), self._type(told.dtype), self._space(())).write(told)

    def _type(self, dtype: np.dtype[Any]) -> Any:
        """HDF5's type of an array's numbers; the same one each time, as making one takes longer than writing with it."""
        if dtype not in self._types:
            self._types[dtype] = self._h5.h5t.py_create(dtype, logical=True)
        return self._types[dtype]

    def _space(self, shape: tuple[int, ...]) -> Any:
        if shape not in self._spaces:
            self._spaces[shape] = self._h5.h5s.create_simple(shape)
        return self._spaces[shape]
