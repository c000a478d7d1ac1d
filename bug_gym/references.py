"""References to code, "module:name" or "file.py:name": how a caller names a class or a function of their own.

To follow one runs what it names. So it comes from a caller or from an installed package; data that holds one is followed
only where a caller trusts it.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from bug_gym.checks import shortened
from bug_gym.naming import nearest_hint

MODULE = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*"


def is_reference(name: str) -> bool:
    """Whether a name says where code is: "module:name" or "file.py:name"."""
    return re.fullmatch(rf"({MODULE}|.+\.py):[A-Za-z_]\w*", name) is not None


def from_anywhere(reference: str) -> str:
    """A reference that means the same in a process that runs in another folder."""
    place, _, name = reference.rpartition(":")
    return f"{Path(place).expanduser().absolute()}:{name}" if place.endswith(".py") else reference


def imported(reference: str, kind: str) -> Any:
    """What lies behind "module:name" or "file.py:name"; a module may lie in the working directory.

    Args:
        reference: the name.
        kind: what an error calls it, "class" or "function".

    Raises:
        ValueError: no such module, file or name in it, or no Python there.
        ImportError: the module imports another one that is missing.
    """
    place, _, name = reference.rpartition(":")
    try:
        module = _module_of_file(place) if place.endswith(".py") else _module(place)
    except SyntaxError as error:
        raise ValueError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    except SystemExit as left:  # a script, whose last line leaves with what it has done
        expected = 'expected one that can be imported: what is to be run stands below if __name__ == "__main__"'
        told = f"{place} ends the process when it is imported (exit code {left.code}), {expected}"
        raise ValueError(told).with_traceback(left.__traceback__) from None
    if not hasattr(module, name):
        own = [key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        raise ValueError(f"{place} has no {kind} {shortened(name)}{nearest_hint(name, own)}")
    return getattr(module, name)


def reference_of(code: Any) -> str:
    """Module and name of a class or function as "module:name"; one of a script says `__main__`."""
    named = code if hasattr(code, "__qualname__") else type(code)
    return f"{named.__module__}:{named.__qualname__}"


def raised_in(error: BaseException) -> str:
    """Where in a caller's own code an error arose, as " (file, line 3)"; "" where the package found a fault by itself.

    The package refuses what a caller's code answers in words of its own; here the code itself has failed.
    """
    import sysconfig  # only where something has failed
    import traceback

    package = Path(__file__).resolve().parent
    known = [package, (package / "agents").resolve()]
    known += [Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "purelib", "platlib")]
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        place = Path(frame.filename)
        if place.is_file() and not any(place.resolve().is_relative_to(folder) for folder in known):
            return f" ({place}, line {frame.lineno})"
    return ""


def told_of(error: BaseException) -> str:
    """What an error says in one line, with its place in a caller's own code and its notes.

    Which kind of error it is stands before what the package does not raise by itself.
    """
    kind = "" if isinstance(error, (ValueError, OSError, ImportError)) else type(error).__name__
    said = ": ".join(filter(None, (kind, _told(error))))
    notes = "".join(f"; {note}" for note in getattr(error, "__notes__", ()))
    return "; ".join(f"{said}{raised_in(error)}{notes}".splitlines())


def _told(error: BaseException) -> str:
    """What an error says, that of a file without the system's number."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error)


@contextmanager
def kept_in_process() -> Iterator[None]:
    """Have a caller's code that ends the process, as `exit()` does, raise an error that says so.

    Raises:
        RuntimeError: it does.
    """
    try:
        yield
    except SystemExit as left:
        told = f"its code ends the process (exit code {left.code})"
        raise RuntimeError(told).with_traceback(left.__traceback__) from None


def code_digest(code: Any) -> str:
    """Digest of the file that code is written in, which tells whether it is still the same.

    In a notebook, whose cells are no files, that of its own lines; "" where nobody knows them.
    """
    code = getattr(code, "py_func", code)
    try:
        written = Path(inspect.getsourcefile(code) or "").read_bytes()
    except (TypeError, OSError):
        try:
            written = inspect.getsource(code).encode()
        except (TypeError, OSError):  # typed in by hand, or run without its source
            return ""
    return hashlib.sha256(written).hexdigest()[:16]


def _module(name: str) -> ModuleType:
    """A module on Python's path, or in the working directory, where a command does not look by itself."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        _require_missing(name, error)
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # workers take this path over
        importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        _require_missing(name, error)
    raise ValueError(f"no module {shortened(name)}, looked for on Python's path and in {here}")


def _require_missing(name: str, error: ModuleNotFoundError) -> None:
    """Raise an error on, where another module is missing than the one of this name."""
    if not f"{name}.".startswith(f"{error.name}."):
        raise error


def _module_of_file(place: str) -> ModuleType:
    """The module that a file holds, run once for each text of it; what lies beside it can be imported."""
    path = Path(place).expanduser().absolute()
    if not path.is_file():
        raise ValueError(f"no file {place}")
    digest = hashlib.sha256(f"{path}\0".encode() + path.read_bytes()).hexdigest()[:16]
    name = f"{path.stem}_{digest}"  # a worker that goes on reads a changed file again
    if name in sys.modules:
        return sys.modules[name]
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None  # the name ends in .py
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        specification.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
