"""Compiled code on disk: what one process keeps there, no other one spoils."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bug_gym.compiling import called

MODULE = """
from bug_gym.compiling import kernel

@kernel
def double(x):
    return x + x
"""

# The first one has written the index and is about to write the code; the second one read the index before that.
FIRST = """
import pathlib, time, double
files = double.double._cache._cache_file
save = files._save_data
def save_when_told(name, data):
    pathlib.Path("waiting").touch()
    while not pathlib.Path("told").exists():
        time.sleep(0.01)
    save(name, data)
files._save_data = save_when_told
double.double(21)
"""
SECOND = """
import double
double.double._cache._cache_file._load_index = dict
double.double(1.5)
"""


def test_processes_that_compile_at_once_do_not_write_one_anothers_code(tmp_path: Path) -> None:
    (tmp_path / "double.py").write_text(MODULE)
    settings = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def python(code: str) -> list[str]:
        return [sys.executable, "-c", code]

    with subprocess.Popen(python(FIRST), cwd=tmp_path, env=settings) as first:
        while not (tmp_path / "waiting").exists():
            assert first.poll() is None
            time.sleep(0.01)
        subprocess.run(python(SECOND), cwd=tmp_path, env=settings, check=True)
        (tmp_path / "told").touch()
    assert first.returncode == 0
    third = python("import double; print(double.double(1.5), double.double(21))")
    told = subprocess.run(third, cwd=tmp_path, env=settings, check=True, capture_output=True, text=True)
    assert told.stdout.split() == ["3.0", "42"]


PARTS = """
from bug_gym.compiling import called, inlined, kernel

@called
def power(x, n):
    y = x * 0 + 1
    for _ in range(n):
        y *= x
    return y

@inlined
def cube(x):
    return power(x, 3)

@kernel
def sum_of_powers(x):
    return power(x, 0) + power(x, 1) + power(x, 2) + cube(x)
"""
USE = """
import parts
print(parts.sum_of_powers(2), parts.sum_of_powers(0.5))
print(*(len(function.overloads) for function in (parts.sum_of_powers, parts.cube, parts.power)))
print(sum(parts.sum_of_powers.stats.cache_hits.values()))
"""


def test_a_kernel_holds_what_it_calls_which_is_compiled_once_for_all_constants(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(PARTS)
    settings = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def told() -> list[str]:
        use = [sys.executable, "-c", USE]
        return subprocess.run(
            use, cwd=tmp_path, env=settings, check=True, capture_output=True, text=True
        ).stdout.splitlines()

    sums = "15 1.875"
    assert told() == [sums, "2 2 2", "0"]
    assert told() == [sums, "2 0 0", "2"], "the second process finds the kernel on disk and its parts in it"


def test_what_is_compiled_for_kernels_says_so_to_python() -> None:
    with pytest.raises(TypeError, match="double is compiled for kernels only; make it a @kernel"):
        called(double)(21)


def double(x: int) -> int:
    return x + x


FORKED = """
import os, double
def pattern():
    return double.double._cache._cache_file._data_name_pattern
read, write = os.pipe()
if os.fork() == 0:
    os.write(write, pattern().encode())
    os._exit(0)
os.wait()
print(pattern(), os.read(read, 1000).decode())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process forks here")
def test_a_forked_process_writes_files_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "double.py").write_text(MODULE)
    settings = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    told = subprocess.run(
        [sys.executable, "-c", FORKED], cwd=tmp_path, env=settings, check=True, capture_output=True, text=True
    )
    parent, child = told.stdout.split()
    assert parent != child
    assert len(parent) == len(child)


# One kernel in a folder of two files; what it calls and what it reads lie in the other one.
CALLER = """
from bug_gym.compiling import kernel
from other import FACTOR, changed, copied

@kernel
def product(x):
    return FACTOR * changed(x) + copied(x)
"""
OTHER = """
from bug_gym.compiling import called, inlined

FACTOR = 3

@called
def changed(x):
    return x + 1

@inlined
def copied(x):
    return x * 100
"""
PRODUCT = "import caller; print(caller.product(2), sum(caller.product.stats.cache_hits.values()))"


def test_a_kernel_kept_on_disk_is_compiled_anew_where_any_file_of_its_folder_changed(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "folder", tmp_path / "elsewhere"
    for each in (folder, elsewhere):
        each.mkdir()
    other, unrelated = folder / "other.py", elsewhere / "unrelated.py"
    (folder / "caller.py").write_text(CALLER)
    other.write_text(OTHER)
    unrelated.write_text("x = 1")
    path = os.pathsep.join([str(elsewhere), *sys.path])
    settings = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": path}
    settings["PYTHONDONTWRITEBYTECODE"] = "1"  # Python keeps code by size and second: these edits come too fast for it

    def told() -> list[int]:
        """The product, and how often it was found on disk."""
        use = [sys.executable, "-c", PRODUCT]
        run = subprocess.run(use, cwd=folder, env=settings, check=True, capture_output=True, text=True)
        return [int(word) for word in run.stdout.split()]

    def edit(file: Path, old: str, new: str) -> None:
        assert old in file.read_text()
        times = file.stat().st_atime_ns, file.stat().st_mtime_ns
        file.write_text(file.read_text().replace(old, new))
        os.utime(file, ns=times)  # the same age and size: an unpacked archive may give all files one age

    assert told() == [209, 0]
    assert told() == [209, 1]
    edit(unrelated, "1", "2")
    assert told() == [209, 1]
    edit(other, "x + 1", "x + 2")
    assert told() == [212, 0]
    edit(other, "FACTOR = 3", "FACTOR = 4")
    assert told() == [216, 0]
    edit(other, "x * 100", "x * 200")
    assert told() == [416, 0]
    assert told() == [416, 1]
    (folder / "added.py").write_text("y = 1")
    assert told() == [416, 0]
