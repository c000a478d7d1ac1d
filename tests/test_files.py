"""Writing: whole or not at all, onto regular files only, never another's file; folders with one writer; strict JSON."""

from __future__ import annotations

import ast
import os
import signal
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bug_gym import files
from bug_gym.drawing.clips import save_gif, save_mp4, save_png
from bug_gym.files import HOLDER, LOCK, append, from_json, one_writer, out_path, replaced_when_done, writable

ROOT = Path(__file__).resolve().parents[1]
PIXELS = np.zeros((16, 16, 3), dtype=np.uint8)


def write(path: Path, text: str = "new") -> None:
    """Write a file by the way of all."""
    with replaced_when_done(path) as partial:
        partial.write_text(text)


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


# ---------------------------------------------------------------------------------------------- whole or not at all


names = st.text(st.characters(codec="utf-8", exclude_characters="/\0"), min_size=1, max_size=40).filter(
    lambda name: name not in (".", "..")
)


@settings(max_examples=100, deadline=None)
@given(name=names, before=st.none() | st.binary(), after=st.binary(), others=st.dictionaries(names, st.binary()))
def test_a_file_is_what_was_written_and_no_other_file_changes(
    name: str, before: bytes | None, after: bytes, others: dict[str, bytes]
) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        there = {**others, **({} if before is None else {name: before})}
        there = {one: data for one, data in there.items() if one != name or before is not None}
        for one, data in there.items():
            (folder / one).write_bytes(data)
        with replaced_when_done(folder / name) as partial:
            partial.write_bytes(after)
            assert {path.name: path.read_bytes() for path in folder.iterdir() if path != partial} == there
            assert partial.name.endswith(Path(name).suffix)
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == {**there, name: after}


@pytest.mark.parametrize("before", [None, "old"])
def test_a_failure_leaves_what_was_there(before: str | None, tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    if before:
        target.write_text(before)
    with pytest.raises(KeyboardInterrupt), replaced_when_done(target) as partial:
        partial.write_text("half")
        raise KeyboardInterrupt
    assert names_in(tmp_path) == ({"a.txt"} if before else set())
    assert not before or target.read_text() == before


def test_a_file_is_on_the_disk_before_it_takes_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[tuple[str, bytes]] = []
    sync, replace = os.fsync, Path.replace

    def synced(file: int) -> None:
        sync(file)
        if stat.S_ISREG(os.fstat(file).st_mode):
            (partial,) = tmp_path.iterdir()
            done.append(("sync", partial.read_bytes()))

    def replaced(source: Path, target: Path) -> Path:
        done.append(("replace", source.read_bytes()))
        return replace(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", replaced)
    write(tmp_path / "a.txt")
    assert done == [("sync", b"new"), ("replace", b"new")]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
@pytest.mark.parametrize("make", [write, lambda path: append(path, b"new")])
def test_a_new_file_has_the_usual_permissions(make: Callable[[Path], None], mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        make(tmp_path / "a.txt")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o666 & ~mask


def test_a_file_that_is_replaced_hands_its_permissions_on(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "a.txt").chmod(0o640)
    write(tmp_path / "a.txt")
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


# ---------------------------------------------------------------------------------------------- nobody else's file


@pytest.fixture
def victim(tmp_path: Path) -> Iterator[Path]:
    """A file that nobody asked to change."""
    (tmp_path / "elsewhere").mkdir()
    path = tmp_path / "elsewhere" / "victim"
    path.write_text("mine")
    yield path
    assert path.read_text() == "mine"


def test_a_link_that_lies_where_a_partial_file_used_to_is_not_written_through(tmp_path: Path, victim: Path) -> None:
    (tmp_path / "a.partial.png").symlink_to(victim)
    (tmp_path / "keep.partial.png").write_text("mine")
    save_png(tmp_path / "a.png", PIXELS)
    save_png(tmp_path / "keep.png", PIXELS)
    assert (tmp_path / "a.partial.png").is_symlink() and (tmp_path / "keep.partial.png").read_text() == "mine"


def test_a_partial_file_is_made_new_even_where_its_name_was_guessed(
    tmp_path: Path, victim: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "urandom", lambda count: bytes(count))
    with replaced_when_done(tmp_path / "a.png") as partial:
        name = partial.name
    (tmp_path / "a.png").unlink()
    (tmp_path / name).symlink_to(victim)
    with pytest.raises(FileExistsError):
        write(tmp_path / "a.png")
    assert (tmp_path / name).is_symlink() and not (tmp_path / "a.png").exists()


def test_names_of_partial_files_differ(tmp_path: Path) -> None:
    with replaced_when_done(tmp_path / "a.png") as one, replaced_when_done(tmp_path / "a.png") as other:
        assert one != other


def test_a_partial_file_that_was_exchanged_is_refused_and_left(tmp_path: Path, victim: Path) -> None:
    with pytest.raises(ValueError, match="exchanged"), replaced_when_done(tmp_path / "a.txt") as partial:
        partial.unlink()
        partial.symlink_to(victim)
    assert partial.is_symlink() and not (tmp_path / "a.txt").exists()


def test_a_link_that_comes_while_a_file_is_written_is_refused(tmp_path: Path, victim: Path) -> None:
    with pytest.raises(ValueError, match="a symbolic link"), replaced_when_done(tmp_path / "a.txt") as partial:
        partial.write_text("new")
        (tmp_path / "a.txt").symlink_to(victim)
    assert names_in(tmp_path) == {"a.txt", "elsewhere"} and (tmp_path / "a.txt").is_symlink()


def not_regular(folder: Path, kind: str, victim: Path) -> Path:
    """Something at `folder / "x"` that is no regular file."""
    path = folder / "x"
    if kind == "a folder":
        path.mkdir()
    elif kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as one:
            one.bind("x")  # an absolute path may be too long for a socket
    else:
        path.symlink_to(victim if kind == "a symbolic link" else folder / "nowhere")
    return path


@pytest.mark.parametrize("way", [write, lambda path: append(path, b"new")])
@pytest.mark.parametrize("kind", ["a folder", "a pipe", "a socket", "a symbolic link", "a broken link"])
def test_what_is_no_regular_file_is_neither_replaced_nor_written_to(
    kind: str, way: Callable[[Path], None], tmp_path: Path, victim: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = not_regular(tmp_path, kind, victim)
    before = path.lstat()
    with pytest.raises(ValueError, match=kind.replace("broken", "symbolic")):
        way(path)
    assert os.path.samestat(path.lstat(), before)
    assert names_in(tmp_path) == {"x", "elsewhere"}


NOBODY_ASKS = """
import os, sys
from bug_gym.files import writable
if os.getuid() == 0:  # who may write anywhere
    os.setuid(65534)
try:
    print(writable(sys.argv[1]))
except ValueError as error:
    print(error)
"""


@pytest.mark.skipif(os.name == "nt", reason="of users and modes as POSIX has them")
def test_a_folder_that_may_not_be_written_into_is_told_before_the_work() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for mode, told in [(0o777, f"{folder}/new"), (0o555, f"the folder {folder} does not let this user write new")]:
            Path(folder).chmod(mode)
            command = [sys.executable, "-c", NOBODY_ASKS, f"{folder}/new"]
            said = subprocess.run(command, capture_output=True, text=True, check=True)
            assert said.stdout.startswith(told)


def test_devices_and_folders_are_not_writable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for path, said in ((os.devnull, "a device"), (".", "a folder"), ("..", "a folder"), ("", "a folder")):
        with pytest.raises(ValueError, match=said):
            writable(path)
    for path in ("nowhere/a", "nowhere/../a"):
        with pytest.raises(ValueError, match="no folder"):
            writable(path)


def test_something_that_is_appended_follows_what_was_there(tmp_path: Path) -> None:
    for data in (b"one\n", b"", b"two\n"):
        append(tmp_path / "a.jsonl", data)
    assert (tmp_path / "a.jsonl").read_bytes() == b"one\ntwo\n"


@pytest.mark.parametrize(("save", "suffix"), [(save_png, ".png"), (save_gif, ".gif"), (save_mp4, ".mp4")])
def test_a_picture_is_written_only_under_a_name_that_says_what_it_is(save: Any, suffix: str, tmp_path: Path) -> None:
    content = (PIXELS,) if save is save_png else ([PIXELS] * 2, 10.0)
    for name in ("a.xyz", "a", suffix, f"a{suffix}.txt"):
        with pytest.raises(ValueError, match=f"ends in {suffix}"):
            save(tmp_path / name, *content)
    assert not names_in(tmp_path)
    save(tmp_path / f"a{suffix.upper()}", *content)
    assert names_in(tmp_path) == {f"a{suffix.upper()}"}


WRITERS = {
    "write_text",
    "write_bytes",
    "savefig",
    "to_csv",
    "rename",
    "renames",
    "mkstemp",
    "copyfile",
    "copy",
    "tofile",
}
"""Methods that make or change a file; `copy` of the shutil module alone."""


def writes_in(source: str) -> Iterator[str]:
    """Calls that write a file which `replaced_when_done` did not give: its users call it `partial`."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name | ast.Attribute):
            continue
        name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
        of = ast.unparse(node.func.value) if isinstance(node.func, ast.Attribute) else ""
        modes = [arg.value for arg in node.args if isinstance(arg, ast.Constant) and isinstance(arg.value, str)]
        opens = name == "open" and any(set(mode) & set("wax+") and len(mode) <= 3 for mode in modes)
        saves = name in WRITERS and not (name == "copy" and of != "shutil")
        renames = name == "replace" and of == "os"
        given = any("partial" in ast.unparse(one) for one in (node.func, *node.args))
        if (opens or saves or renames) and not given:
            yield f"line {node.lineno}: {ast.unparse(node)}"


def test_everything_that_is_written_goes_through_one_writer() -> None:
    package = ROOT / "bug_gym"
    paths = {*package.rglob("*.py"), *(package / "agents").rglob("*.py")} - {package / "files.py"}  # agents is a link
    found = {path: list(writes_in(path.read_text(encoding="utf-8"))) for path in paths}
    assert not {path: lines for path, lines in found.items() if lines}


def test_calls_that_write_are_seen() -> None:
    source = "p.write_text('a')\nopen(p, 'w')\np.open('ab')\nfigure.savefig(p)\nos.replace(a, b)\nshutil.copy(a, b)\n"
    assert len(list(writes_in(source))) == 6
    assert not list(writes_in("partial.write_text('a')\np.open()\nopen(p, 'rb')\na.replace('b', 'c')\nx.copy()\n"))


# ---------------------------------------------------------------------------------------------- one writer


HOLD = (
    "import sys\nfrom pathlib import Path\nfrom bug_gym.files import one_writer\n"
    "with one_writer(Path(sys.argv[1])):\n    print('held', flush=True)\n    sys.stdin.read()\n"
)


@pytest.fixture
def other_process(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that holds the folder."""
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_folder_that_another_process_holds_is_refused_with_its_number(
    tmp_path: Path, other_process: subprocess.Popen[str]
) -> None:
    said = rf"in use: process {other_process.pid} on {socket.gethostname()} has been writing there since \d{{4}}-.* UTC"
    with pytest.raises(ValueError, match=said), one_writer(tmp_path):
        pass


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_folder_of_a_dead_process_is_free(
    tmp_path: Path, other_process: subprocess.Popen[str], number: signal.Signals
) -> None:
    other_process.send_signal(number)
    other_process.wait()
    assert (tmp_path / HOLDER).exists()
    with one_writer(tmp_path):
        assert from_json((tmp_path / HOLDER).read_bytes())["pid"] == os.getpid()
    assert names_in(tmp_path) == {LOCK}


def test_a_folder_is_free_again_after_its_writer(tmp_path: Path) -> None:
    for _ in range(2):
        with pytest.raises(KeyError), one_writer(tmp_path):
            with pytest.raises(ValueError, match=f"process {os.getpid()} "), one_writer(tmp_path):
                pass
            raise KeyError
    with one_writer(tmp_path):
        pass


def test_a_holder_that_nobody_can_read_is_told_as_another_process(
    tmp_path: Path, other_process: subprocess.Popen[str]
) -> None:
    for text in ("", "null", "{}", "[1]"):
        (tmp_path / HOLDER).write_text(text)
        with pytest.raises(ValueError, match="in use by another process"), one_writer(tmp_path):
            pass


@pytest.mark.parametrize("name", [LOCK, HOLDER])
def test_a_link_in_the_place_of_the_lock_is_refused(name: str, tmp_path: Path, victim: Path) -> None:
    (tmp_path / name).symlink_to(victim)
    with pytest.raises(ValueError, match="a symbolic link"), one_writer(tmp_path):
        pass
    assert (tmp_path / name).is_symlink()
    (tmp_path / name).unlink()
    with one_writer(tmp_path):
        pass


def test_a_file_alone_is_kept_to_its_writer_and_its_folder_is_free(tmp_path: Path) -> None:
    one, other = tmp_path / "one.jsonl", tmp_path / "other.jsonl"
    said = pytest.raises(ValueError, match=f"one.jsonl is in use: process {os.getpid()} ")
    with one_writer(one), one_writer(other), one_writer(tmp_path), said, one_writer(one):
        pass
    assert not any(name.endswith(HOLDER) for name in names_in(tmp_path))


# ---------------------------------------------------------------------------------------------- homes


def test_a_tilde_is_a_home_wherever_something_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    write(Path("~/a.txt"))
    append("~/b.txt", b"b")
    assert names_in(tmp_path) == {"a.txt", "b.txt"}
    with pytest.raises(ValueError, match="~nobody-of-that-name/a.txt: "):
        out_path("~nobody-of-that-name/a.txt")


# ---------------------------------------------------------------------------------------------- commits


def git(folder: Path, *words: str) -> str:
    """What git says of a folder, or does there."""
    who = ("-c", "user.name=tests", "-c", "user.email=tests@example.org")
    return subprocess.run(["git", "-C", folder, *who, *words], capture_output=True, text=True, check=True).stdout


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a linked folder in a repository that knows only a file of the caller's, and is asked for."""
    package = tmp_path / "bug_gym"
    for folder in (package, tmp_path / "agents"):
        folder.mkdir()
        (folder / "files.py").write_text("")
    (package / "agents").symlink_to(Path("..", "agents"))
    (tmp_path / "mine.py").write_text("")
    for words in (("init", "-q"), ("add", "mine.py"), ("commit", "-q", "-m", "mine")):
        git(tmp_path, *words)
    monkeypatch.setattr(files, "__file__", str(package / "files.py"))
    return package


def test_the_commit_of_a_repository_that_only_lies_around_the_package_is_not_its_own(package: Path) -> None:
    assert files.commit() == "unknown"


@pytest.mark.parametrize("changed", ["bug_gym/files.py", "bug_gym/new.py", "agents/files.py"])
def test_a_commit_says_whether_the_package_was_changed_since(package: Path, changed: str) -> None:
    root = package.parent
    git(root, "add", "-A")
    git(root, "commit", "-q", "-m", "package")
    (root / "notes.txt").write_text("of the caller's")
    head = git(root, "rev-parse", "HEAD").strip()
    assert files.commit() == head
    (root / changed).write_text("changed")
    assert files.commit() == f"{head}-dirty"


def test_without_git_the_commit_is_unknown(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(package))
    assert files.commit() == "unknown"


# ---------------------------------------------------------------------------------------------- strict JSON


@settings(max_examples=100, deadline=None)
@given(data=st.binary() | st.text(st.sampled_from('[]{}",:0123456789.eE+-nulltrueN aI\\u')).map(str.encode))
def test_any_bytes_are_a_value_or_a_value_error(data: bytes) -> None:
    try:
        from_json(data)
    except ValueError as error:
        assert str(error)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("NaN", "got NaN"),
        ("[-Infinity]", "got -Infinity"),
        ('{"a": 1, "a": 2}', "key 'a' twice"),
        ("[" * 100_000, "nested too deep"),
        ("1" * 10_000, "digits"),
        ("\ufeff1", "BOM|Expecting"),
        ("", "Expecting value"),
    ],
)
def test_json_that_is_not_strict_is_refused(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        from_json(text.encode())
