"""Compiled code where there is no place for it, and where its files are damaged: it is compiled again, and one line says so."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bug_gym import compiling
from bug_gym.compiling import is_only_ours

MODULE = """
from bug_gym.compiling import kernel

@kernel
def double(x):
    return x + x

@kernel
def triple(x):
    return x + x + x
"""
USE = """
import double
from bug_gym.compiling import is_ready
ready = is_ready(double.double)
print(ready, double.double(21), double.triple(2), sum(double.double.stats.cache_hits.values()))
"""


def told(folder: Path, code: str = USE, **settings: str) -> tuple[str, list[str]]:
    """What a new process prints in a folder, and the lines of its log."""
    (folder / "double.py").write_text(MODULE)
    environment = {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path]), "PATH": os.environ["PATH"], **settings}
    run = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip(), run.stderr.splitlines()


# ---------------------------------------------------------------------------------------------- damage


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "cut": cut,
    "one bit": flip,
    "text": lambda content: b"not a pickle\n",
    "longer": lambda content: content + b"x",
}


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_a_damaged_file_is_thrown_away_and_its_code_compiled_again(ending: str, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert told(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ("False 42 6 0", [])
    for damage in DAMAGES.values():
        (file,) = [path for path in cache.rglob(f"*{ending}") if path.name.startswith("double.double")]
        file.write_bytes(damage(file.read_bytes()))
        said, lines = told(tmp_path, NUMBA_CACHE_DIR=str(cache))
        assert said == "False 42 6 0", "it is not ready, and not found on disk"
        assert lines == [f"{file} is damaged: thrown away, and compiled again"]
    assert told(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ("True 42 6 1", [])


def test_code_whose_data_is_gone_is_not_ready(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    told(tmp_path, NUMBA_CACHE_DIR=str(cache))
    for file in cache.rglob("double.double*.nbc"):
        file.unlink()
    assert told(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ("False 42 6 0", [])


def test_code_for_another_machine_is_not_ready(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert told(tmp_path, NUMBA_CACHE_DIR=str(cache), NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")[0][:5] == "False"
    assert told(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ("False 42 6 0", [])


FULL = """
import os, double
from numba.core.caching import IndexDataCacheFile
def no_room(self, path):
    raise OSError(28, os.strerror(28))
IndexDataCacheFile._open_for_write = no_room
print(double.double(21), double.triple(2))
"""


def test_code_that_cannot_be_written_serves_and_one_line_says_so(tmp_path: Path) -> None:
    said, lines = told(tmp_path, FULL, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert said == "42 6"
    (line,) = lines
    assert line.startswith("compiled code cannot be kept in") and line.endswith("No space left on device")


# ---------------------------------------------------------------------------------------------- no place

NO_PLACE = """
from numba.core.caching import InTreeCacheLocator, UserWideCacheLocator
for place in (InTreeCacheLocator, UserWideCacheLocator):
    place.ensure_cache_path = lambda self: (_ for _ in ()).throw(PermissionError(self.get_cache_path()))
"""
"""As where the installation is read-only and there is no home: a test that runs as root can write anywhere."""


def test_where_there_is_no_place_a_temporary_folder_serves_all_processes_of_a_user(tmp_path: Path) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    said, lines = told(tmp_path, NO_PLACE + USE, TMPDIR=str(temporary))
    (kept,) = temporary.iterdir()
    assert said == "False 42 6 0"
    assert lines == [f"no place to keep compiled code (NUMBA_CACHE_DIR can name one): it is kept in {kept}"]
    assert told(tmp_path, NO_PLACE + USE, TMPDIR=str(temporary)) == ("True 42 6 1", lines)
    assert is_only_ours(kept) and kept.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("planted", ["link", "file", "writable"])
def test_a_folder_that_somebody_else_can_write_to_is_not_used(planted: str, tmp_path: Path) -> None:
    temporary, elsewhere = tmp_path / "temporary", tmp_path / "elsewhere"
    for folder in (temporary, elsewhere):
        folder.mkdir()
    name = temporary / f"bug_gym-{os.getuid()}"
    if planted == "link":
        name.symlink_to(elsewhere)
    elif planted == "file":
        name.write_text("mine")
    else:
        name.mkdir()
        name.chmod(0o777)
    said, (line,) = told(tmp_path, NO_PLACE + USE, TMPDIR=str(temporary))
    assert said == "False 42 6 0"
    assert "it is kept in" in line and not line.endswith(str(name))
    assert not list(elsewhere.iterdir())
    assert planted == "file" or not list(name.iterdir())


NOWHERE = "import tempfile; tempfile.gettempdir = lambda: (_ for _ in ()).throw(FileNotFoundError('nowhere'))\n"


def test_where_nothing_can_be_written_code_is_compiled_and_not_kept(tmp_path: Path) -> None:
    # Without numba's own use of the folder: it asks for a temporary file to see whether a place is writable.
    said, lines = told(tmp_path, NO_PLACE + NOWHERE + USE)
    assert said == "False 42 6 0"
    assert lines == ["no place to keep compiled code, not even a temporary folder: each process compiles by itself"]


READ_ONLY = """
import os
if os.getuid() == 0:  # who may write anywhere
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
import gymnasium, bug_gym
from bug_gym.agents import make_policy
env = gymnasium.make("BugGym/Static-v0")
print(make_policy("bug0", env).predict(env.reset(seed=0)[0])[0].shape)
"""


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that every user may read; pytest's own are the user's alone."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


def others_read(place: Path) -> bool:
    """Whether every user may read what lies there."""
    return all(folder.stat().st_mode & 0o001 for folder in (place, *place.parents))


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="of users and homes as POSIX has them")
@pytest.mark.skipif(
    not all(others_read(Path(place).resolve().parent) for place in (os.__file__, pytest.__file__, sys.executable)),
    reason="no other user can read this Python",
)
def test_nobody_without_a_home_plays_from_a_read_only_installation(open_folder: Path) -> None:
    installed, temporary = open_folder / "installed", open_folder / "temporary"
    root = Path(compiling.__file__).resolve().parents[1]
    for name in ("bug_gym", "agents", "configs"):
        shutil.copytree(root / name, installed / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for folder, _, _ in os.walk(installed):
        Path(folder).chmod(0o555)
    temporary.mkdir()
    temporary.chmod(0o1777)
    environment = {"PYTHONPATH": str(installed), "PATH": os.environ["PATH"], "TMPDIR": str(temporary)}
    environment["HOME"] = str(installed / "no such home")
    run = subprocess.run(
        [sys.executable, "-B", "-c", READ_ONLY], cwd="/", env=environment, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout.strip()) == (0, "(2,)"), run.stderr
    kept, compiles = run.stderr.splitlines()
    assert kept.startswith("no place to keep compiled code") and kept.endswith(f"bug_gym-{os.getuid() or 65534}")
    assert compiles.startswith("compiling the simulation's kernels")
    again = subprocess.run(
        [sys.executable, "-B", "-c", READ_ONLY], cwd="/", env=environment, capture_output=True, text=True, check=True
    )
    assert again.stderr.splitlines() == [kept]
