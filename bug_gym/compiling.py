"""How the kernels are compiled: by numba, kept on disk, each function once.

What Python calls is a `kernel`; what only kernels call is `called` or, where it is copied into its callers, `inlined`,
or, where it never is, kept `apart`.
By itself numba would optimise each function, make machine code of it and an entry for Python, and then do so again for
each function above it that took it in. A third of the time to compile is saved where only kernels go to the end.

That is done inside numba, by `dispatchers`. Where it cannot be, or BUG_GYM_PLAIN_NUMBA=1 is set, numba's own `njit`
serves: it compiles for longer, and the results are the same bit for bit.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import os
import re
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterable
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config as numba_config
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])

logger = logging.getLogger("bug_gym")

# The minor releases of numba with which `dispatchers` was tried, from and to. Others get plain numba, as an inside that
# changed may show only when a kernel is compiled, or in what it computes; BUG_GYM_PLAIN_NUMBA=0 tries all the same.
TRIED = ((0, 61), (0, 68))

# What the results depend on. Both ways of compiling share these, and numba documents them.
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def own_dispatchers() -> Any:
    """The module `dispatchers`, None where plain numba is to serve."""
    told = os.environ.get("BUG_GYM_PLAIN_NUMBA", "")
    if told not in ("", "0"):
        return None
    if not told and not TRIED[0] <= minor_release(numba.__version__) <= TRIED[1]:
        logger.warning("not tried with numba %s: it compiles by itself, which takes longer", numba.__version__)
        return None
    try:
        from bug_gym import dispatchers  # loads numba's insides, which a release may have changed
    except (ImportError, AttributeError, TypeError) as error:
        logger.warning("numba %s compiles by itself, which takes longer: %s", numba.__version__, error)
        return None
    return dispatchers


def minor_release(version: str) -> tuple[int, int]:
    """Its first two numbers; (0, 0) for a build that has none."""
    match = re.match(r"(\d+)\.(\d+)", version)
    return (int(match[1]), int(match[2])) if match else (0, 0)


DISPATCHERS = own_dispatchers()
PROCESS = uuid.uuid4().hex[:12]
KERNELS: list[Any] = []
"""All that are kept on disk."""

PACKAGE = Path(__file__).parent


def kernel(function: Function) -> Function:
    """Compiles a function for Python, and for other kernels, and keeps it on disk.

    What it calls and the constants that it reads may lie in the files of its own folder and in `bug_gym.kernels`; a
    change of any other file is not noticed.
    """
    stamp = stamp_of(function)
    kept = for_python(function)
    return cast(Function, kept if stamp is not None and keep(kept, stamp) else for_python(function))


def called(function: Function) -> Function:
    """Compiles a function for kernels."""
    return cast(Function, for_kernels(function))


def inlined(function: Function) -> Function:
    """Compiles a function for kernels, which take in a copy of it wherever they call it."""
    return cast(Function, for_kernels(function, forceinline=True))


def apart(function: Function) -> Function:
    """Compiles a function for kernels, which jump to it and never take in a copy.

    For what is large and rare: LLVM would copy what is called from a few places into each, and what that calls into each
    copy.
    """
    return cast(Function, for_kernels(function, "Apart", forceinline=False))


def vectors(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose LLVM code is written out (its first parameter is numba's and not the caller's)."""
    return cast(Callable[..., Any], intrinsic(function))


def for_python(function: Callable[..., Any]) -> Any:
    """A function compiled to the end, not kept."""
    if DISPATCHERS is None:
        return numba.njit(**OPTIONS)(function)
    return DISPATCHERS.Kernel(function, targetoptions={**OPTIONS, **DISPATCHERS.OPTIONS})


def for_kernels(function: Callable[..., Any], kind: str = "Callee", **options: Any) -> Any:
    """A function compiled for others; to plain numba all are alike, and LLVM decides what it copies."""
    if DISPATCHERS is None:
        return for_python(function)
    return getattr(DISPATCHERS, kind)(function, targetoptions={**OPTIONS, **DISPATCHERS.OPTIONS, **options})


# ---------------------------------------------------------------------------------------------- files


def keep(dispatcher: Any, stamp: str) -> bool:
    """Have a dispatcher write compiled code to files that no other process writes, and read what bears its stamp.

    False where this numba keeps its files in another way, or there is no place for them. That dispatcher must not be
    used: by numba's stamp alone it would run code of sources that have changed since.
    """
    try:
        from bug_gym.kept_code import KeptCache  # loads numba's insides, which a release may have changed

        make = functools.partial(KeptCache, dispatcher.py_func, stamp, PROCESS)
        cache = made_somewhere(make)
    except (ImportError, AttributeError):
        return False
    if cache is None:
        return False
    dispatcher._cache = cache
    KERNELS.append(dispatcher)
    return True


def made_somewhere(make: Callable[[], Any]) -> Any:
    """A cache: where numba finds no place for it, in a temporary folder; None where there is none either."""
    try:
        return make()
    except RuntimeError:  # a read-only installation, and no home to write in
        folder = temporary_folder()
    if folder is None:
        return None
    config: Any = numba_config  # numba makes its attributes from the environment
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        return make()
    except RuntimeError:
        return None
    finally:
        config.CACHE_DIR = before


@functools.cache
def temporary_folder() -> Path | None:
    """A folder for compiled code that processes of the same user share, and nobody else can write to; it is said once.

    None where nothing can be written.
    """
    try:
        folder = Path(tempfile.gettempdir(), f"bug_gym-{os.getuid() if hasattr(os, 'getuid') else 'code'}")
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if not is_only_ours(folder):  # code that somebody else can write must not be run
            folder = Path(tempfile.mkdtemp(prefix="bug_gym-"))
    except OSError:
        logger.warning("no place to keep compiled code, not even a temporary folder: each process compiles by itself")
        return None
    if parent_process() is None:  # a worker's parent has said it
        logger.warning("no place to keep compiled code (NUMBA_CACHE_DIR can name one): it is kept in %s", folder)
    return folder


def is_only_ours(folder: Path) -> bool:
    """Whether a folder is one, of this user, and only this user can write to it."""
    seen = folder.lstat()
    is_mine = not hasattr(os, "getuid") or (seen.st_uid == os.getuid() and not seen.st_mode & 0o022)
    return stat.S_ISDIR(seen.st_mode) and is_mine


def types_of(*arguments: Any) -> tuple[Any, ...]:
    """The types that a kernel is compiled for where it is called with these arguments."""
    return tuple(map(numba.typeof, arguments))


def is_ready(function: Callable[..., Any], types: tuple[Any, ...] | None = None) -> bool:
    """Whether a kernel is compiled for these types, or for any: in this process, or on disk.

    What is on disk counts where it is whole, of the kernel as it is written today, and for this machine.
    """
    dispatcher: Any = function
    if types in dispatcher.signatures or (types is None and dispatcher.signatures):
        return True
    if not any(dispatcher is kept for kept in KERNELS):
        return False
    _, *code = dispatcher._cache._index_key((), dispatcher.targetctx.codegen())
    return bool(dispatcher._cache.files.holds(code, types))


def take_own_name() -> None:
    """Give a forked process files of its own; it comes with the names of its parent's."""
    global PROCESS
    parent, PROCESS = PROCESS, uuid.uuid4().hex[:12]
    for dispatcher in KERNELS:
        dispatcher._cache.files.take_name(parent, PROCESS)


if hasattr(os, "register_at_fork"):  # not on Windows, where no process forks
    os.register_at_fork(after_in_child=take_own_name)


# ---------------------------------------------------------------------------------------------- stamps


def stamp_of(function: Callable[..., Any]) -> str | None:
    """What tells compiled code of today's sources from older code, None for a function whose source is in no file.

    Numba's own stamp tells of the function's file only, but its code holds what it calls and the constants that it
    reads: one edited elsewhere would not count. A function typed into a notebook may call what another cell holds.
    """
    file = Path(function.__code__.co_filename)
    if not file.is_file() and not getattr(sys, "frozen", False):  # a frozen program is stamped by numba, as one file
        return None
    return " ".join([own_stamp(), folder_stamp(PACKAGE / "kernels"), folder_stamp(file.parent)])


@functools.cache
def own_stamp() -> str:
    """How functions are compiled; plain numba does not run what was made by `dispatchers`, nor the other way round."""
    way = "plain" if DISPATCHERS is None else "own"
    sources = [Path(__file__), *(PACKAGE / f"{name}.py" for name in ("dispatchers", "shortcuts", "kept_code"))]
    return f"numba {numba.__version__} {way} {contents(sources)}"


@functools.cache
def folder_stamp(folder: Path) -> str:
    """The modules of a folder, read once in a process."""
    return contents(sorted(file for file in folder.glob("*.py") if file.stem.isidentifier()))


def contents(files: Iterable[Path]) -> str:
    """A digest of names and contents, which are all the same age where an archive was unpacked (1.5 ms for 500 kB)."""
    digest = hashlib.sha256()
    for file in files:
        try:
            content = file.read_bytes()
        except OSError:  # what cannot be read, of another user say, is not called either
            continue
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()
