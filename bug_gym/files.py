"""Files that are written whole or not at all, folders with one writer, strict JSON, and where results come from.

Everything that this package writes goes through `replaced_when_done`, `append`, or for a folder `moved_when_done`. The first
two write regular files and new ones only: a device, a folder, a pipe is refused, and so is a symbolic link, which is neither
replaced nor written through.
"""

from __future__ import annotations

import errno
import json
import os
import platform
import re
import shutil
import socket
import stat
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import bug_gym

LOCK, HOLDER = ".lock", ".lock.json"
"""What `one_writer` puts into a folder: what is locked, and who holds it. Beside a file its name stands before."""
PARTIAL = ".partial"
"""Part of the name of every file that is not yet whole; a kill leaves such a file behind."""

KINDS = {
    stat.S_IFLNK: "a symbolic link",
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}
"""What is no regular file, by its bits of the mode."""


# ---------------------------------------------------------------------------------------------------------------------
# Writing
# ---------------------------------------------------------------------------------------------------------------------


def out_path(path: str | os.PathLike[str]) -> Path:
    """The path that a caller writes to, with `~` for a home.

    Raises:
        ValueError: nobody's home.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise ValueError(f"{path}: {error}") from None


def writable(path: str | Path, suffixes: Sequence[str] = ()) -> Path:
    """The path of a file to write; to be asked before the work, not after it.

    Args:
        path: of a new file, or of a regular one that is to be replaced; `~` stands for a home.
        suffixes: what the name may end in, such as `.png`, in small or large letters; none: anything.

    Raises:
        ValueError: another suffix, no folder to write into, or none that this user may, or something there that is no regular
            file.
    """
    target = out_path(path)
    if suffixes and target.suffix.lower() not in suffixes:
        *first, last = suffixes
        allowed = f"{', '.join(first)} or {last}" if first else last
        raise ValueError(f"got {target} to write to, expected a name that ends in {allowed}")
    if not target.parent.is_dir():
        raise ValueError(f"no folder {target.parent} to write {target.name} into")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise ValueError(f"the folder {target.parent} does not let this user write {target.name} into it")
    with suppress(FileNotFoundError):
        mode = target.lstat().st_mode
        if not stat.S_ISREG(mode):
            kind = KINDS.get(stat.S_IFMT(mode), "something else")
            raise ValueError(f"{target} is {kind}, expected a regular file or a new name")
    return target


def file_name(label: str) -> str:
    """A label as part of a file's name: it comes from files too, which say nothing about the folder that is written to."""
    return re.sub(r"[^\w.-]+", "_", label).lstrip(".") or "unnamed"


FULL = frozenset(getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO") if hasattr(errno, name))
"""Of errors of the system: a disk that takes no more."""


@contextmanager
def replaced_when_done(path: str | Path) -> Iterator[Path]:
    """A place to write a file to, which takes its name once it is whole and on the disk; a failure leaves nothing.

    The place has the suffix of the path, and an unpredictable name in its folder that was nobody's before. What it
    replaces hands its permissions on; those of a new file are the usual ones.

    Raises:
        ValueError: the path is not `writable`, or somebody else has put another file in the place.
    """
    target = writable(path)
    partial = target.with_name(f".{os.urandom(8).hex()}{PARTIAL}{target.suffix}")
    own = partial.open("xb")  # made new, so neither another's file nor one behind a link
    made = os.fstat(own.fileno())
    try:
        with own, _named(target):
            yield partial
            os.fsync(own.fileno())
            if not _is_at(partial, made):
                raise ValueError(f"{partial} was taken away or exchanged while {target} was written into it")
        if writable(target).exists():
            partial.chmod(stat.S_IMODE(target.lstat().st_mode))
        partial.replace(target)
        _sync(target.parent)
    finally:
        if _is_at(partial, made):
            partial.unlink()


def _is_at(path: Path, made: os.stat_result) -> bool:
    """Whether a file that was made lies at a path, and no other."""
    try:
        return os.path.samestat(path.lstat(), made)
    except FileNotFoundError:
        return False


def _sync(folder: Path) -> None:
    """Let a new name outlive a loss of power, on systems that can be asked for it."""
    if os.name == "posix":
        with suppress(OSError):
            opened = os.open(folder, os.O_RDONLY)
            try:
                os.fsync(opened)
            finally:
                os.close(opened)


@contextmanager
def moved_when_done(stage: Path, path: Path) -> Iterator[Path]:
    """A folder to fill, which moves to its path once it is whole and on the disk.

    Args:
        stage: where it is filled, on the disk of `path`; a kill leaves it, and the next try begins it anew.
        path: where it goes, which nothing may be at; the folders above it are made.

    Raises:
        ValueError: something is at the path, or the stage is no folder.
    """
    if os.path.lexists(path):
        raise ValueError(f"{path} is there already")
    if stage.is_symlink() or (stage.exists() and not stage.is_dir()):
        raise ValueError(f"{stage} is no folder")
    shutil.rmtree(stage, ignore_errors=True)
    stage.mkdir(parents=True)
    yield stage
    for file in stage.rglob("*"):
        if file.is_file():
            with file.open("rb+") as opened:
                os.fsync(opened.fileno())
    path.parent.mkdir(parents=True, exist_ok=True)
    stage.rename(path)
    _sync(path.parent)


def put_aside(path: Path, name: str) -> None:
    """Give a file or folder another name in its folder; a file of that name is replaced, a folder is not.

    Raises:
        OSError: it cannot be done, as where a folder of that name holds something.
    """
    path.replace(path.with_name(name))
    _sync(path.parent)


def append(path: str | Path, data: bytes) -> None:
    """Add to the end of a file, which is made where it is missing; all is on the disk when this returns.

    Raises:
        ValueError: the path is not `writable`.
    """
    target = writable(path)
    with _named(target), open(target, "ab", opener=_open_itself) as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Have an error of a disk that takes no more, which says nothing of the file, name it."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL and error.filename is None:
            error.filename = str(path)
        raise


def _open_itself(path: str, flags: int) -> int:
    """Open a file, but nothing behind a link that has come since `writable` looked."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


@contextmanager
def one_writer(path: Path) -> Iterator[None]:
    """Keep a folder, or a file alone, to this process; the system frees what a dead process held.

    Args:
        path: of a folder that is there, or of a file, which may be missing: what is locked lies beside it then.

    Raises:
        ValueError: another one writes there; the message tells which.
    """
    from filelock import FileLock, Timeout

    held, holder = (path / name if path.is_dir() else path.with_name(f".{path.name}{name}") for name in (LOCK, HOLDER))
    lock = FileLock(writable(held))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(f"{path} is in use{_told_holder(holder)}") from None
    try:
        with replaced_when_done(holder) as partial:
            partial.write_text(json.dumps({"pid": os.getpid(), "host": socket.gethostname()}), encoding="utf-8")
        try:
            yield
        finally:
            holder.unlink(missing_ok=True)
    finally:
        lock.release()


def _told_holder(path: Path) -> str:
    """Who holds a folder or a file, as far as it can be told."""
    try:
        holder, since = from_json(path.read_bytes()), np.datetime64(int(path.stat().st_mtime), "s")
        return f": process {holder['pid']} on {holder['host']} has been writing there since {since} UTC"
    except (OSError, ValueError, KeyError, TypeError):
        return " by another process"


# ---------------------------------------------------------------------------------------------------------------------
# Reading
# ---------------------------------------------------------------------------------------------------------------------


def from_json(data: bytes) -> Any:
    """The value of some strict JSON.

    Raises:
        ValueError: it is none, a key of it stands twice, or it is nested too deep.
    """
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_no_constant, object_pairs_hook=_distinct)
    except RecursionError:
        raise ValueError("nested too deep") from None


def _no_constant(name: str) -> Any:
    raise ValueError(f"got {name}, expected a finite number")


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise ValueError(f"key {name[:60]!r} twice")
        found[name] = value
    return found


# ---------------------------------------------------------------------------------------------------------------------
# Where results come from
# ---------------------------------------------------------------------------------------------------------------------


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    versions = {"bug_gym": bug_gym.__version__, "python": platform.python_version()}
    versions |= {name: version(name) for name in ("gymnasium", "numpy", "numba")}
    return {"cpu": cpu_model(), "cores": os.cpu_count(), **versions}


def released(version: str) -> str:
    """What results are compared by: 0.2.0 of 0.2.0.dev7+g1234567, as else each commit would have results of its own."""
    return re.sub(r"(\.dev\d+)?(\+.*)?$", "", version)


def commit() -> str:
    """The commit that this package's source lies in, with "-dirty" where it is not quite that; "unknown" where there is none.

    A repository that only lies around the source, as a caller's does around an environment in it, knows nothing of it.
    """
    if _git("ls-files", "--error-unmatch", Path(__file__).name) is None:
        return "unknown"
    links = [str(path.resolve()) for path in Path(__file__).parent.iterdir() if path.is_symlink()]  # agents, configs
    head, changed = _git("rev-parse", "HEAD"), _git("status", "--porcelain", "--", ".", *links)
    return "unknown" if head is None or changed is None else f"{head}-dirty" if changed else head


def _git(*words: str) -> str | None:
    """What git says of this package's folder; None where it fails, or there is no git."""
    try:
        told = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), *words], capture_output=True, text=True, check=False
        )
    except OSError:
        return None
    return None if told.returncode else told.stdout.strip()


def cpu_model() -> str:
    """Name of the processor, as well as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
