"""The command line, `bug-gym`: the commands of bug_gym.commands, their errors and exit codes.

Exit codes: 0 done, 1 what was printed could not be written (and Python's own for a fault of ours), 2 bad input or a file that
cannot be read or written, 3 `reproduce --strict` found a claim false, 130 interrupted, 128 + n ended by signal n, as 141 where
the reader of a pipe has gone. One line on stderr says what was wrong; a reader that has seen enough needs none. What a command
needs is imported when it runs, so that `--help` is quick.
"""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, TextIO, cast

from bug_gym import __version__
from bug_gym.commands import COMMANDS
from bug_gym.references import raised_in, told_of

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

DONE, UNWRITTEN, BAD_INPUT, SIGNALLED = 0, 1, 2, 128
BROKEN_PIPE = SIGNALLED + 13
"""What a shell says of a program that SIGPIPE has ended."""

ENDINGS = ("SIGTERM", "SIGHUP")
"""Signals on which a command ends as on Ctrl-C; those that this system has."""


class Ended(KeyboardInterrupt):
    """A signal asks this process to end: whatever cares for Ctrl-C cares for it, too."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and leave with exit code 2."""
        self.exit(BAD_INPUT, f"bug-gym: error: {message} (see {self.prog} --help)\n")

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help; argparse's own says nothing where it cannot be written."""
        print(self.format_help(), end="", file=file or sys.stdout)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    _end_without_looking_through_memory()
    with _open_streams() as unseen:
        try:
            code = _run(arguments)
        except SystemExit as left:
            if written := _write_out():
                return written
            if isinstance(getattr(sys.stdout, "failure", None), BrokenPipeError):  # rich ends with 1 there
                return BROKEN_PIPE
            if unseen.tell() and not left.code:
                return _complain(UNWRITTEN, "error: standard output is closed")
            raise
        if code == DONE and unseen.tell():
            return _complain(UNWRITTEN, "error: standard output is closed")
        return _write_out() or code


def _end_without_looking_through_memory() -> None:
    """Have Python leave everything where it is when the process ends.

    Else it looks several times for cycles among all that torch has loaded, for some 2 s of processor time, in which a
    command that was asked to end is still there.
    """
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)


def _run(arguments: Sequence[str] | None) -> int:
    options = argparse.Namespace()
    try:
        parser = make_parser()
        options, unknown = parser.parse_known_args(_without_gaps(sys.argv[1:] if arguments is None else arguments))
        if unknown:
            options.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        with _ended_by_signals():
            code: int | None = options.run(options)
    except BrokenPipeError as error:
        if not _is_reader_gone():  # another pipe broke, of a film's writer say
            return _complain(BAD_INPUT, f"error: {error}")
        _drop_output()
        return BROKEN_PIPE
    except (ValueError, OSError, ImportError) as error:
        if error is getattr(sys.stdout, "failure", None):
            _drop_output()
            return _complain(UNWRITTEN, f"error: standard output: {getattr(error, 'strerror', error)}")
        return _complain(BAD_INPUT, f"error: {told_of(error)}")
    except KeyboardInterrupt as error:
        number = error.number if isinstance(error, Ended) else signal.SIGINT
        told = ("interrupted", *getattr(error, "__notes__", ()), _told_left(options))
        return _complain(SIGNALLED + number, "; ".join(filter(None, told)))
    except Exception as error:
        if not raised_in(error):
            raise  # a fault of ours: who reports it sends the whole of it
        return _complain(BAD_INPUT, f"error: {told_of(error)}")
    return code or DONE


def _told_left(options: argparse.Namespace) -> str:
    """What a command that is interrupted leaves, and what the same one would do then; "" where it leaves nothing."""
    out = getattr(options, "out", None)
    if not out or not COMMANDS[options.command].goes_on:
        return ""
    told: Callable[[], str] | None = getattr(options, "told_left", None)  # of a command that knows better
    if told is not None:
        return told()
    if not os.path.lexists(out):
        return "nothing was done so far, the same command begins anew"
    return f"{out} keeps what is done, the same command goes on"


def _without_gaps(arguments: Sequence[str]) -> Sequence[str]:
    """The arguments, none of which is empty, as "$NAME" is where a shell has no NAME: all policies are not meant then.

    Raises:
        ValueError: one is.
    """
    for before, argument in zip(("", *arguments), arguments, strict=False):
        if re.fullmatch(r"(--[\w-]+=)?", argument):
            raise ValueError(f"got an empty argument after {before or 'the command'!r}, expected a value")
    return arguments


def _complain(code: int, message: str) -> int:
    line = re.sub(r"[\x00-\x1f\x7f-\x9f]", lambda found: ascii(found[0])[1:-1], "; ".join(message.splitlines()))
    print("bug-gym:", line, file=sys.stderr)
    return code


# ---------------------------------------------------------------------------------------------- streams


class _Output:
    """A stream that remembers why it could not be written: such an error is not one of the command's files.

    What its encoding has no character for it writes in another way: no work is lost for a dash.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        """Write to the stream."""
        try:
            return self.stream.write(text)
        except UnicodeEncodeError:
            return self.stream.write(_told_plainly(text, self.stream.encoding))
        except OSError as error:
            self.failure = error
            raise

    def flush(self) -> None:
        """Write what the stream holds."""
        try:
            self.stream.flush()
        except OSError as error:
            self.failure = error
            raise

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def _told_plainly(text: str, encoding: str) -> str:
    """A text as an encoding can write it: a dash as a hyphen, as wide, other characters that it lacks by their numbers."""
    return text.replace("–", "-").encode(encoding, "backslashreplace").decode(encoding)


@contextmanager
def _open_streams() -> Iterator[io.StringIO]:
    """Stand-ins for streams that are closed (`>&-`), which Python has as None; gives that of stdout.

    The numbers of closed streams are taken, else the next file that is opened would get one, and what a library prints.
    """
    unseen, before = io.StringIO(), (sys.stdout, sys.stderr)
    if None in before:
        while (number := os.open(os.devnull, os.O_RDWR)) < 3:
            os.set_inheritable(number, True)  # children print to it
        os.close(number)
    sys.stdout = unseen if sys.stdout is None else cast(TextIO, _Output(sys.stdout))
    sys.stderr = io.StringIO() if sys.stderr is None else sys.stderr
    try:
        yield unseen
    finally:
        sys.stdout, sys.stderr = before


def _write_out() -> int:
    """Write what was printed; returns an exit code where that is not possible, and drops it."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_output()
        return BROKEN_PIPE
    except OSError as error:
        _drop_output()
        return _complain(UNWRITTEN, f"error: standard output: {error.strerror}")
    return DONE


def _is_reader_gone() -> bool:
    """Whether nobody reads stdout any more."""
    try:
        sys.stdout.flush()  # which fails as long as it holds what it could not write
    except BrokenPipeError:
        return True
    if not hasattr(select, "poll"):
        return True
    pipe = select.poll()
    pipe.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in pipe.poll(0))


def _drop_output() -> None:
    """Lead stdout to nowhere: Python tries again to write what it holds when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# ---------------------------------------------------------------------------------------------- signals


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Raise Ended where a signal would end the process at once; a second one does end it at once.

    A signal that is ignored, as SIGHUP is under `nohup`, stays so. Where a library raises KeyboardInterrupt for whatever
    its waiting was broken off by, as Ray does, Ended takes its place.
    """
    is_main = threading.current_thread() is threading.main_thread()  # no other thread may ask for signals
    numbers = [getattr(signal, name) for name in ENDINGS if hasattr(signal, name)] if is_main else []
    ours = [number for number in numbers if signal.getsignal(number) is signal.SIG_DFL]
    asked: list[int] = []

    def end(number: int, frame: FrameType | None) -> NoReturn:
        for one in ours:
            signal.signal(one, signal.SIG_DFL)
        asked.append(number)
        raise Ended(number)

    for number in ours:
        signal.signal(number, end)
    try:
        yield
    except KeyboardInterrupt as error:
        if not asked or isinstance(error, Ended):
            raise
        ended = Ended(asked[0])
        for note in getattr(error, "__notes__", ()):
            ended.add_note(note)
        raise ended from error
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def make_parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(prog="bug-gym", description="2D navigation among unknown obstacles: worlds, policies, evaluations.")
    parser.add_argument("--version", action="version", version=f"bug-gym {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", parser_class=Parser)
    for name, command in COMMANDS.items():
        added = commands.add_parser(
            name,
            help=command.summary,
            description=command.summary,
            epilog=f"example:\n  {command.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module = import_module(command.module)
        module.add_arguments(added)
        added.set_defaults(command=name, run=module.run, parser=added)
    return parser
