"""The command line, `bug-gym`: the commands of bug_gym.commands, their errors and exit codes.

Exit codes: 0 done, 2 bad input (one line on stderr says what), 130 interrupted. What a command needs is imported when
it runs, so that `--help` is quick.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from bug_gym.commands import COMMANDS

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and leave with exit code 2."""
        self.exit(BAD_INPUT, f"bug-gym: error: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    options = make_parser().parse_args(arguments)
    try:
        options.run(options)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError, ImportError) as error:
        return _complain(BAD_INPUT, f"error: {error}")
    except KeyboardInterrupt:
        out = getattr(options, "out", None)
        goes_on = out and COMMANDS[options.command].goes_on
        hint = f"; {out} keeps what is done, the same command goes on" if goes_on else ""
        return _complain(INTERRUPTED, f"interrupted{hint}")
    return DONE


def _complain(code: int, message: str) -> int:
    print("bug-gym:", "; ".join(message.splitlines()), file=sys.stderr)
    return code


def make_parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(prog="bug-gym", description="2D navigation among unknown obstacles: worlds, policies, evaluations.")
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
        added.set_defaults(command=name, run=module.run)
    return parser
