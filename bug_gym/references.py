"""References to code, "module:name" or "file.py:name": how a caller names a class or a function of their own.

To follow one runs what it names. So it comes from a caller or from an installed package; data that holds one is followed
only where a caller trusts it.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import json
import operator
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from bug_gym.checks import shortened
from bug_gym.naming import nearest_hint

MODULE = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*"
INSTALLED = frozenset(("site-packages", "dist-packages"))
"""Folders of installed packages."""


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


# ---------------------------------------------------------------------------------------------------------------------
# Whether code is still the same
# ---------------------------------------------------------------------------------------------------------------------


@cache
def source_digest() -> str:
    """SHA-256 of this package's Python files, settings and records of models, as hexadecimal digits.

    It is the same for a checkout and a wheel of it, on any system; records of models have the checksums of their other files.
    """
    package = str(Path(__file__).parent)
    digest = hashlib.sha256()
    for folder, inner, names in os.walk(package, followlinks=True):
        inner[:] = _with_sources(inner)
        for name in sorted(names):
            if name.endswith((".py", ".yaml", ".json")) and not name.startswith("."):
                file = os.path.join(folder, name)  # noqa: PTH118 - paths as objects would take half of the time
                digest.update(f"{file[len(package) + 1 :].replace(os.sep, '/')}\n".encode())
                with open(file, "rb") as opened:  # noqa: PTH123
                    digest.update(opened.read().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def code_digest(code: Any) -> str:
    """Digest of what a class or function is written in, which tells whether it is still the same.

    That is its file, of a class also those of its bases, and where one of these files lies in a package all that lies there;
    this package, Python's and installed ones are left out, but for that of the class itself. Of a notebook's function, whose
    cells are no files, it is the digest of its own lines; "" where nobody knows them, as those of a class there. What a
    function holds beside its lines belongs to it, as `make_term(0.5)` and `make_term(2.0)` are two; "" where that is more
    than data, as the object of a bound method.

    Raises:
        ValueError: a file was changed after it was imported: what runs is not what it says now.
    """
    code = inspect.unwrap(getattr(code, "py_func", code))
    try:
        held = _held(code)
    except (TypeError, ValueError, AttributeError):  # no data, or in a circle, or not there yet
        return ""
    written: set[tuple[str, str]] = set()
    for one in _callers_classes(code) if isinstance(code, type) else [code]:
        found = _written(one)
        if not found:
            return ""
        written |= found.items()
    return _short(json.dumps([*sorted(written), *held]).encode())


def place_digest(reference: str) -> str:
    """Digest of the file in which "module:name" or "file.py:name" has been found: of what is made there, and no function.

    Raises:
        ValueError: the file was changed after it was imported.
    """
    place = reference.rpartition(":")[0]
    if not place.endswith(".py"):
        file = Path(sys.modules[place].__file__ or "")
        digest = _short(file.read_bytes())
        _require_as_imported(file, place, digest)
        return digest
    file = Path(place)
    if _name_of_text(file) not in sys.modules:
        raise ValueError(_told_changed(file))
    return _short(file.read_bytes())


def _held(code: Any) -> list[str]:
    """What a function holds beside its lines, as text: values about it, and of arguments that no file fixes.

    Raises:
        TypeError, ValueError, AttributeError: more than data.
    """
    if isinstance(code, MethodType) and not isinstance(code.__self__, type):
        raise TypeError(f"{code.__qualname__} is of an object")
    if not isinstance(code, FunctionType):
        return []
    values: list[Any] = [cell.cell_contents for cell in code.__closure__ or ()]
    if "<" in code.__qualname__:  # a lambda, or made by a function
        values += filter(None, (code.__defaults__, code.__kwdefaults__))
    return [json.dumps(value, default=operator.methodcaller("tolist")) for value in values]


def note_code(code: Any) -> None:
    """Take down what a class or function is written in now, so that a change after this is noticed."""
    with suppress(ValueError, OSError):  # whoever asks for the digest is told
        code_digest(code)


_MODULES: WeakKeyDictionary[ModuleType, tuple[Any, str]] = WeakKeyDictionary()
"""The specification of each module that was asked about, which another import replaces, and the digest of its file then."""
_CODE: WeakKeyDictionary[Any, tuple[list[CodeType], str]] = WeakKeyDictionary()
"""What each class or function that was asked about runs, which a notebook's autoreload replaces, and the digest likewise."""


_STAMPS: dict[str, tuple[int, int]] = {}
"""When each file of callers' modules was written [ns], and its size, as `edits` has found them last."""
_edits = 0


def edits() -> int:
    """How often files that this process has imported from callers were found changed.

    Workers that began before have imported what these said then.
    """
    global _edits
    now, ours = {}, __name__.partition(".")[0]
    for name, module in [*sys.modules.items()]:
        top = name.partition(".")[0]
        file = getattr(module, "__file__", None) if type(module) is ModuleType else None  # a lazy one stays so
        if file and top not in (ours, "__main__") and not _is_others(top, file):
            with suppress(OSError):
                status = Path(file).stat()
                now[file] = status.st_mtime_ns, status.st_size
    _edits += any(_STAMPS.get(file, stamp) != stamp for file, stamp in now.items())
    _STAMPS.update(now)
    return _edits


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _with_sources(folders: list[str]) -> list[str]:
    """Those of some folders in which sources may lie, sorted."""
    return sorted(name for name in folders if name not in ("__pycache__", *INSTALLED) and not name.startswith("."))


def _callers_classes(found: type[Any]) -> list[type[Any]]:
    """A class and those of its bases that are neither of this package nor of Python or an installed one."""
    return [one for one in found.__mro__ if one is found or not (_is_ours(one) or _is_installed(one))]


def _is_ours(code: Any) -> bool:
    return _top(code) == __name__.partition(".")[0]


def _is_installed(found: type[Any]) -> bool:
    place = getattr(sys.modules.get(found.__module__), "__file__", None) or ""
    return _is_others(_top(found), place)


def _is_others(top: str, place: str) -> bool:
    """Whether a file of a module at the top is Python's or an installed one."""
    return top in sys.stdlib_module_names or not INSTALLED.isdisjoint(Path(place).parts)


def _top(code: Any) -> str:
    """The package or module at the top in which code lies."""
    return str(getattr(code, "__module__", None) or "").partition(".")[0]


def _written(code: Any) -> dict[str, str]:
    """Digests of the files that a class or function is written in, by name, its package's too; of lines that are in no file."""
    try:
        file = Path(inspect.getsourcefile(code) or "")
        digest = _short(file.read_bytes())
    except (TypeError, OSError):
        try:
            return {code.__qualname__: _short(inspect.getsource(code).encode())}
        except (TypeError, OSError, AttributeError):  # typed in by hand, or run without its source
            return {}
    if code.__module__ != "__main__":
        _require_as_imported(file, code.__module__, digest)
    functions = vars(code).values() if isinstance(code, type) else [code]
    runs = [function.__code__ for function in functions if isinstance(function, FunctionType)]
    known, before = _CODE.get(code, ([], ""))
    if not before or len(known) != len(runs) or not all(map(operator.is_, known, runs)):
        _CODE[code] = runs, digest
    elif before != digest:
        if code.__module__ == "__main__":  # a script, which workers do not import: it is what it was
            return {file.name: before}
        raise ValueError(_told_changed(file))
    for folder in getattr(sys.modules.get(_top(code)), "__path__", ()) if not _is_ours(code) else ():
        if file.is_relative_to(folder):
            return _package(Path(folder))
    return {file.name: digest}


def _package(folder: Path) -> dict[str, str]:
    """Digests of the Python files of a package, by name."""
    digests = {}
    for place, inner, names in os.walk(folder):
        inner[:] = _with_sources(inner)
        for file in (Path(place, name) for name in names if name.endswith(".py") and not name.startswith(".")):
            name = file.relative_to(folder.parent)
            digest = digests[name.as_posix()] = _short(file.read_bytes())
            _require_as_imported(file, ".".join(name.with_suffix("").parts).removesuffix(".__init__"), digest)
    return digests


def _require_as_imported(file: Path, name: str, digest: str) -> None:
    """Refuse a file that has changed since somebody first asked about the module of this name, where it is of that file."""
    module = sys.modules.get(name)
    if module is None or getattr(module, "__file__", None) != str(file):
        return
    specification = getattr(module, "__spec__", None)
    known, before = _MODULES.get(module, (None, ""))
    if known is None or known is not specification:
        _MODULES[module] = specification, digest
    elif before != digest:
        raise ValueError(_told_changed(file))


def _told_changed(file: Path) -> str:
    return f"{file.name} was changed after it was imported: reload it, or restart"


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


class _Text(SourceFileLoader):
    """Runs a file as it is written, never bytecode kept of what it was: Python tells the two apart by second and size."""

    def get_code(self, fullname: str) -> CodeType:
        """The compiled text."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def _name_of_text(file: Path) -> str:
    """The name of the module that holds a file as it is written now."""
    return f"{file.stem}_{_short(f'{file}'.encode() + bytes(1) + file.read_bytes())}"


def _module_of_file(place: str) -> ModuleType:
    """The module that a file holds, run once for each text of it; what lies beside it can be imported."""
    path = Path(place).expanduser().absolute()
    if not path.is_file():
        raise ValueError(f"no file {place}")
    name = _name_of_text(path)  # a worker that goes on reads a changed file again
    if name in sys.modules:
        return sys.modules[name]
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    specification = importlib.util.spec_from_file_location(name, path, loader=_Text(name, str(path)))
    assert specification is not None and specification.loader is not None  # the name ends in .py
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        specification.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
