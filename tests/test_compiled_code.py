"""Compiled code on disk: what one process keeps there, no other one spoils."""

from __future__ import annotations

import ast
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numba.core.caching
import pytest

from bug_gym import compiling
from bug_gym.compiling import called, kernel

IS_PLAIN = compiling.DISPATCHERS is None  # numba's own njit is what these tests run on


def output(code: str, folder: Path, **settings: str) -> list[str]:
    """The lines that a new process prints in a folder."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **settings}
    use = [sys.executable, "-c", code]
    run = subprocess.run(use, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    return run.stdout.splitlines()


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


POWERS = """
from bug_gym.compiling import apart, called, inlined, kernel

@{kind}
def power(x, n):
    y = x * 0 + 1
    for _ in range(n):
        y *= x
    return y

@inlined
def cube(x):
    return power(x, 3)

@kernel
def sum_of_powers({parameters}):
    return {sum}
"""
PARTS = POWERS.format(kind="called", parameters="x", sum="power(x, 0) + power(x, 1) + power(x, 2) + cube(x)")
USE = """
import parts
print(parts.sum_of_powers(2), parts.sum_of_powers(0.5))
print(*(len(function.overloads) for function in (parts.sum_of_powers, parts.cube, parts.power)))
print(sum(parts.sum_of_powers.stats.cache_hits.values()))
"""


def test_a_kernel_holds_what_it_calls_which_is_compiled_once_for_all_constants(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(PARTS)
    first, second = (output(USE, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache")) for _ in range(2))
    assert (first[0], second[0]) == ("15 1.875", "15 1.875")
    assert (first[2], second[2]) == ("0", "2"), "the second process finds the kernel on disk"
    assert second[1] == "2 0 0", "and its parts in it"
    assert first[1] == "2 2 2" or IS_PLAIN, "plain numba compiles a callee for each constant"


APART = POWERS.format(kind="apart", parameters="x, last", sum="power(x, 1) + cube(x) + power(last, 2)")
USE_APART = """
from bug_gym import shortcuts
held = [(owner, name) for owner, name, _, _ in shortcuts.ASKED_AGAIN]
held += [(shortcuts.event, "start_event"), (shortcuts.event, "end_event"), (shortcuts.arrayobj, "fix_integer_index")]
before = [getattr(*one) for one in held]
import bug_gym, parts
print(parts.sum_of_powers(2.0, 3.0))
(code,) = parts.sum_of_powers.inspect_llvm().values()
print(any(line.startswith("define") and "5parts5power" in line for line in code.splitlines()))
print(before == [getattr(*one) for one in held])
"""


@pytest.mark.skipif(IS_PLAIN, reason="what plain numba copies is for LLVM to say")
def test_what_is_apart_is_jumped_to_from_each_caller_and_numba_is_left_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(APART)
    assert output(USE_APART, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache")) == ["19.0", "True", "True"]


@pytest.mark.skipif(IS_PLAIN, reason="plain numba compiles everything for Python too")
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
    settings = {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(elsewhere), *sys.path]),
        "PYTHONDONTWRITEBYTECODE": "1",  # Python keeps code by size and second: these edits come too fast for it
    }

    def told() -> list[int]:
        """The product, and how often it was found on disk."""
        return [int(word) for word in output(PRODUCT, folder, **settings)[0].split()]

    def edit(file: Path, old: str, new: str) -> None:
        assert old in file.read_text()
        times = file.stat().st_atime_ns, file.stat().st_mtime_ns
        file.write_text(file.read_text().replace(old, new))
        os.utime(file, ns=times)  # the same age and size: an unpacked archive may give all files one age

    assert told() == [209, 0]
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


def test_a_stamp_tells_of_the_worlds_kernels_too_and_theirs_of_no_other_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = {name: tmp_path / name for name in ("kernels", "agents")}
    for folder in folders.values():
        folder.mkdir()
        (folder / "code.py").write_text("def f(): pass")
    monkeypatch.setattr(compiling, "PACKAGE", tmp_path)

    def stamps() -> dict[str, str | None]:
        """Those of one function of each folder, as another process would read them."""
        compiling.folder_stamp.cache_clear()
        made: dict[str, str | None] = {}
        for name, folder in folders.items():
            code: dict[str, Any] = {}
            exec(compile("def f(): pass", folder / "code.py", "exec"), code)
            made[name] = compiling.stamp_of(code["f"])
        return made

    before = stamps()
    (folders["agents"] / "code.py").write_text("def f(): ...")
    between = stamps()
    (folders["kernels"] / "code.py").write_text("def f(): ...")
    after = stamps()
    compiling.folder_stamp.cache_clear()
    assert (before["kernels"] == between["kernels"], before["agents"] == between["agents"]) == (True, False)
    assert (between["kernels"] == after["kernels"], between["agents"] == after["agents"]) == (False, False)


READY = """
import double
from bug_gym.compiling import is_ready
before = is_ready(double.double)
double.double(21)
print(before, is_ready(double.double))
"""


def test_a_kernel_is_ready_where_it_is_compiled_here_or_kept_as_it_is_written_today(tmp_path: Path) -> None:
    (tmp_path / "double.py").write_text(MODULE)

    def told() -> list[str]:
        return output(READY, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache"))

    assert told() == ["False True"]
    assert told() == ["True True"]
    (tmp_path / "added.py").write_text("x = 1")
    assert told() == ["False True"], "an index of older sources is there, and nothing of it is run"


TYPES = """
import double
from bug_gym.compiling import is_ready, types_of
before = [is_ready(double.double, types_of(x)) for x in (1, 0.5)]
double.double(21)
print(*before, *(is_ready(double.double, types_of(x)) for x in (1, 0.5)))
"""


def test_a_kernel_is_ready_for_the_types_that_it_is_compiled_for(tmp_path: Path) -> None:
    (tmp_path / "double.py").write_text(MODULE)

    def told() -> list[str]:
        return output(TYPES, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache"))

    assert told() == ["False False True False"]
    assert told() == ["True False True False"]


CHOOSES = """
from bug_gym.compiling import called, kernel

@called
def half(x, shift):
    if shift is not None:
        return missing(x)
    return x / 2

@kernel
def quarter(x, shift):
    return half(half(x, shift), shift)
"""


def test_what_stands_behind_is_not_none_is_not_compiled_for_none(tmp_path: Path) -> None:
    """Worlds of one robot and no regions rest on that: `missing` is nowhere."""
    (tmp_path / "chooses.py").write_text(CHOOSES)
    assert output("import chooses; print(chooses.quarter(8.0, None))", tmp_path) == ["2.0"]


ASKED = """
import parts
print(parts.sum_of_sums(2), len(parts.sum_of_powers.overloads), parts.sum_of_powers(2))
"""


@pytest.mark.skipif(IS_PLAIN, reason="plain numba compiles everything for Python too")
def test_a_kernel_that_only_another_kernel_calls_is_not_compiled_for_python(tmp_path: Path) -> None:
    more = "\n@kernel\ndef sum_of_sums(x):\n    return sum_of_powers(x) + sum_of_powers(x + 1)\n"
    (tmp_path / "parts.py").write_text(PARTS + more)
    assert output(ASKED, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache")) == ["55 0 15"]


DOUBLE = "import double; print(double.double(21), sum(double.double.stats.cache_hits.values()))"


def test_what_is_kept_by_one_way_of_compiling_is_not_run_by_the_other(tmp_path: Path) -> None:
    (tmp_path / "double.py").write_text(MODULE)

    def told(is_plain: str) -> list[str]:
        settings = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "BUG_GYM_PLAIN_NUMBA": is_plain}
        return output(DOUBLE, tmp_path, **settings)

    assert [told("0"), told("0"), told("1"), told("1")] == [["42 0"], ["42 1"], ["42 0"], ["42 1"]]


def test_a_function_of_no_file_is_compiled_but_not_kept() -> None:
    typed: dict[str, Any] = {}
    exec("def triple(x):\n    return 3 * x", typed)
    triple: Any = kernel(typed["triple"])
    assert triple(2) == 6
    assert triple.stats.cache_path is None


# ---------------------------------------------------------------------------------------------- other releases of numba


@pytest.mark.parametrize(
    ("version", "told", "is_own"),
    [
        ("0.61.0", "", True),
        ("0.68.1", "", True),
        ("0.60.0", "", False),
        ("0.69.0dev0+12.g3a", "", False),
        ("1.0.0", "", False),
        ("0+unknown", "", False),
        ("1.0.0", "0", True),
        ("0.68.1", "0", True),
        ("0.68.1", "1", False),
    ],
)
def test_plain_numba_serves_where_it_is_asked_for_and_where_its_release_was_not_tried(
    version: str, told: str, is_own: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("numba.__version__", version)
    monkeypatch.setenv("BUG_GYM_PLAIN_NUMBA", told)
    with caplog.at_level(logging.WARNING, "bug_gym"):
        assert (compiling.own_dispatchers() is not None) == is_own
    lines = [] if is_own or told else [f"not tried with numba {version}: it compiles by itself, which takes longer"]
    assert [record.message for record in caplog.records] == lines


@pytest.mark.parametrize(
    "change",
    [
        "sys.modules['numba.core.compiler_machinery'] = None",
        "del numba.core.typed_passes.NativeLowering",
        "numba.core.registry.CPUDispatcher = None",
    ],
)
def test_plain_numba_serves_where_its_insides_are_others(change: str, tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(PARTS)
    prelude = f"import sys, numba; {change}\nfrom bug_gym import compiling; print(compiling.DISPATCHERS)"
    settings = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "BUG_GYM_PLAIN_NUMBA": "0"}
    use = f"{prelude}\nimport parts; print(parts.sum_of_powers(2), parts.sum_of_powers(0.5))"
    assert output(use, tmp_path, **settings) == ["None", "15 1.875"]


def test_what_cannot_be_stamped_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Any = numba.core.caching.Cache.__init__

    def make_otherwise(self: Any, function: Any) -> None:
        made(self, function)
        self._other_file = self.__dict__.pop("_cache_file")

    monkeypatch.setattr(numba.core.caching.Cache, "__init__", make_otherwise)
    count = len(compiling.KERNELS)
    twice: Any = kernel(double)
    assert twice(21) == 42
    assert twice.stats.cache_path is None
    assert len(compiling.KERNELS) == count


PLAYED = """
import hashlib
import gymnasium
import numpy
import bug_gym
from bug_gym import compiling

env = gymnasium.make("BugGym/Dynamic-v0")
env.action_space.seed(3)
seen = hashlib.sha256()
observation, _ = env.reset(seed=5)
for _ in range(60):
    observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
    for name in sorted(observation):
        seen.update(observation[name].tobytes())
    seen.update(numpy.float64(reward).tobytes())
    if terminated or truncated:
        observation, _ = env.reset()
print(compiling.DISPATCHERS is None, seen.hexdigest())
"""


@pytest.mark.slow
def test_an_episode_is_the_same_bit_for_bit_where_plain_numba_compiled_it(tmp_path: Path) -> None:
    settings = {"NUMBA_CACHE_DIR": str(tmp_path), "BUG_GYM_PLAIN_NUMBA": "1"}
    (own,) = output(PLAYED, tmp_path, BUG_GYM_PLAIN_NUMBA="0")
    (plain,) = output(PLAYED, tmp_path, **settings)
    assert own.split()[0] == "False"
    assert plain.split() == ["True", own.split()[1]]


KERNELS = Path(compiling.__file__).parent / "kernels"


@pytest.mark.parametrize("file", sorted(KERNELS.glob("*.py")), ids=lambda file: file.stem)
def test_no_index_of_kernels_counts_from_the_end(file: Path) -> None:
    """It would read what stands before the array: numba does not ask there (bug_gym/shortcuts.py)."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Subscript):
            indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            negative = [one for one in indices if isinstance(one, ast.UnaryOp) and isinstance(one.op, ast.USub)]
            assert not negative, f"{file.name}, line {node.lineno}: {ast.unparse(node)}"
