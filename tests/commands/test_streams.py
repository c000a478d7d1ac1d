"""The command among other programs: closed outputs, full disks, readers that have gone, signals."""

from __future__ import annotations

import io
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

from bug_gym.cli import main

ROOT = Path(__file__).resolve().parents[2]
POSIX = pytest.mark.skipif(os.name == "nt", reason="of a POSIX shell")


def shell(line: str, *, unbuffered: str = "", pass_fds: tuple[int, ...] = ()) -> subprocess.CompletedProcess[str]:
    """A line of bash, in which PROGRAM is bug-gym; it exits as the program does."""
    program = f"{shlex.quote(sys.executable)} -m bug_gym"
    command = ["bash", "-c", line.replace("PROGRAM", program) + '; exit "${PIPESTATUS[0]}"']
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": unbuffered}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, pass_fds=pass_fds
    )


@POSIX
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", ["list", "--help", "evaluate --help", "list parameters"])
def test_a_reader_that_has_gone_ends_the_command_in_silence(arguments: str, unbuffered: str) -> None:
    read, write = os.pipe()
    os.close(read)  # before the command begins: `| true` may be slower than a short one
    try:
        run = shell(f"PROGRAM {arguments} >&{write}", unbuffered=unbuffered, pass_fds=(write,))
    finally:
        os.close(write)
    assert (run.returncode, run.stderr) == (141, "")


@POSIX
def test_a_reader_of_the_first_line_gets_it() -> None:
    run = shell("PROGRAM list | head -n 1")
    assert (run.stdout, run.stderr) == ("scenarios\n", "")
    assert run.returncode in (0, 141), "0 where all was written before the reader went"


@POSIX
@pytest.mark.parametrize("arguments", ["list", "--help"])
def test_a_closed_output_is_said_in_one_line(arguments: str) -> None:
    run = shell(f"PROGRAM {arguments} >&-")
    assert (run.returncode, run.stderr) == (1, "bug-gym: error: standard output is closed\n")


@POSIX
def test_nothing_is_said_where_both_outputs_are_closed() -> None:
    run = shell("PROGRAM list >&- 2>&-")
    assert (run.returncode, run.stdout, run.stderr) == (1, "", "")


@POSIX
def test_bad_input_is_bad_input_with_a_closed_error_stream() -> None:
    run = shell("PROGRAM show statik 2>&-")
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "")


@POSIX
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("arguments", ["list", "--help"])
def test_a_full_disk_is_said_in_one_line(arguments: str) -> None:
    run = shell(f"PROGRAM {arguments} > /dev/full")
    assert run.returncode == 1
    assert run.stderr == "bug-gym: error: standard output: No space left on device\n"


CLOSED = """
import sys
from bug_gym import cli
from bug_gym.commands import list as command
def run(options):
    with open(sys.argv[1], "w") as file:
        print(file.fileno(), file=file)
command.run = run
cli.main(["list"])
"""


@POSIX
def test_no_file_gets_the_number_of_a_closed_output(tmp_path: Path) -> None:
    line = f"{shlex.quote(sys.executable)} -c {shlex.quote(CLOSED)} {tmp_path}/file >&- 2>&-"
    run = shell(line)
    assert run.returncode == 0
    assert int((tmp_path / "file").read_text()) > 2


PRINTING = """
import sys
from rich.console import Console
from rich.table import Table
from bug_gym import cli
from bug_gym.commands import list as command
def run(options):
    table = Table("a")
    table.add_row("b")
    Console().print(table)
command.run = run
raise SystemExit(cli.main(["list"]))
"""


@POSIX
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_table_whose_reader_has_gone_ends_in_silence_too(unbuffered: str) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        line = f"{shlex.quote(sys.executable)} -c {shlex.quote(PRINTING)} >&{write}"
        run = shell(line, unbuffered=unbuffered, pass_fds=(write,))
    finally:
        os.close(write)
    assert (run.returncode, run.stderr) == (141, "")


@POSIX
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_table_on_a_full_disk_is_said_in_one_line(unbuffered: str) -> None:
    run = shell(f"{shlex.quote(sys.executable)} -c {shlex.quote(PRINTING)} > /dev/full", unbuffered=unbuffered)
    assert (run.returncode, run.stderr) == (1, "bug-gym: error: standard output: No space left on device\n")


@pytest.mark.parametrize("encoding", ["latin-1", "ascii", "cp437", "utf-8"])
def test_what_an_encoding_lacks_is_written_in_another_way(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(options: object) -> None:
        table = Table("a", "b")
        table.add_row("–", "日")
        Console().print(table)
        print("–")

    monkeypatch.setattr("bug_gym.commands.list.run", run)
    written = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(written, encoding=encoding))
    assert main(["list"]) == 0
    dash, name = ("–", "日") if encoding == "utf-8" else ("-", r"\u65e5")
    *_, row, _, last = written.getvalue().decode(encoding).splitlines()
    assert dash in row and name in row and last == dash


def test_another_pipe_that_breaks_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(options: object) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr("bug_gym.commands.list.run", broken)
    assert main(["list"]) == 2
    assert capfd.readouterr().err == "bug-gym: error: [Errno 32] Broken pipe\n"


WAITING = """
import os, signal, sys
from bug_gym import cli
from bug_gym.commands import list as command
def run(options):
    os.kill(os.getpid(), getattr(signal, sys.argv[1]))
    signal.pause()
command.run = run
BEFORE
raise SystemExit(cli.main(["list"]))
"""
AS_FROM_A_TERMINAL = """
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
"""
"""Whoever runs these tests may ignore signals, as nohup does, and hands that on."""


@POSIX
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130)])
def test_a_signal_ends_a_command_as_ctrl_c_does(name: str, code: int) -> None:
    program = WAITING.replace("BEFORE", AS_FROM_A_TERMINAL)
    run = shell(f"{shlex.quote(sys.executable)} -c {shlex.quote(program)} {name}")
    assert (run.returncode, run.stdout, run.stderr) == (code, "", "bug-gym: interrupted\n")


@POSIX
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130)])
def test_a_library_that_waits_may_raise_what_it_likes_for_a_signal(name: str, code: int) -> None:
    waits = "try:\n        os.kill(os.getpid(), getattr(signal, sys.argv[1])); signal.pause()\n"
    raises = "    except BaseException:\n        raise KeyboardInterrupt from None"  # as Ray's wait does
    asked = "os.kill(os.getpid(), getattr(signal, sys.argv[1]))\n    signal.pause()"
    program = WAITING.replace("BEFORE", AS_FROM_A_TERMINAL).replace(asked, waits + raises)
    run = shell(f"{shlex.quote(sys.executable)} -c {shlex.quote(program)} {name}")
    assert (run.returncode, run.stdout, run.stderr) == (code, "", "bug-gym: interrupted\n")


IGNORING = WAITING.replace("signal.pause()", "print('goes on')").replace("BEFORE", "")


@POSIX
def test_a_signal_that_is_ignored_stays_ignored() -> None:
    run = shell(f"trap '' HUP; {shlex.quote(sys.executable)} -c {shlex.quote(IGNORING)} SIGHUP")
    assert (run.returncode, run.stdout, run.stderr) == (0, "goes on\n", "")
