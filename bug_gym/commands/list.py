"""`bug-gym list`: names of scenarios, policies, suites, trainings, sweeps and reproductions."""

from __future__ import annotations

import argparse
import re
from dataclasses import MISSING
from importlib import import_module
from inspect import Parameter
from itertools import takewhile
from pathlib import Path

from bug_gym.reproductions import REPRODUCTIONS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("what", nargs="?", choices=[*LISTS, *LONG_LISTS], help="which names (default: all)")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    for number, what in enumerate([options.what] if options.what else LISTS):
        lines = (LISTS | LONG_LISTS)[what]()
        width = max(len(name) for name, _ in lines)
        print("\n" * (number > 0) + what)
        for name, summary in lines:
            print(f"  {name:<{width}}  {summary}")


def _scenarios() -> list[tuple[str, str]]:
    from bug_gym.config import SCENARIO_FOLDER, scenario_names  # loads pydantic

    return [(name, _first_sentence(SCENARIO_FOLDER / f"{name}.yaml")) for name in scenario_names()]


def _policies() -> list[tuple[str, str]]:
    from bug_gym.agents import known_agents  # loads the compiler

    known = known_agents()
    marks = {name: " (privileged: reads the map)" if agent.privileged else "" for name, agent in known.items()}
    return [(name, f"{agent.family}; {agent.reference}{marks[name]}") for name, agent in known.items()]


def _suites() -> list[tuple[str, str]]:
    from bug_gym.evaluation.suites import SUITE_FOLDER, suite_names  # loads the compiler

    return [(name, _first_sentence(SUITE_FOLDER / f"{name}.yaml")) for name in suite_names()]


def _reproductions() -> list[tuple[str, str]]:
    modules = {name: import_module(f"bug_gym.reproductions.{module}") for name, module in REPRODUCTIONS.items()}
    return [(name, str(module.__doc__).partition("\n")[0]) for name, module in modules.items()]


def _trainings() -> list[tuple[str, str]]:
    from bug_gym.agents.learning.settings import TRAIN_FOLDER, training_names  # loads the compiler

    return [(name, _first_sentence(TRAIN_FOLDER / f"{name}.yaml")) for name in training_names()]


def _sweeps() -> list[tuple[str, str]]:
    from bug_gym.agents.learning.sweep_settings import SWEEP_FOLDER, sweep_names  # loads the compiler

    return [(name, _first_sentence(SWEEP_FOLDER / f"{name}.yaml")) for name in sweep_names()]


def _parameters() -> list[tuple[str, str]]:
    from bug_gym.agents import parameters_table  # loads the compiler

    lines = []
    for name, one in parameters_table():
        default = "" if one.default in (MISSING, Parameter.empty) else f" = {one.default!r}"
        lines.append((f"{name}.{one.name}", f"{one.type}{default}; {one.text}".rstrip("; ")))
    return lines


LISTS = {
    "scenarios": _scenarios,
    "policies": _policies,
    "suites": _suites,
    "trainings": _trainings,
    "sweeps": _sweeps,
    "reproductions": _reproductions,
}
"""What `bug-gym list` prints, in this order."""

LONG_LISTS = {"parameters": _parameters}
"""What it prints only when asked for it."""


def _first_sentence(path: Path) -> str:
    """The first sentence of what a YAML file says about itself at its top."""
    lines = takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    said = " ".join(line.lstrip("# ") for line in lines)
    return re.split(r"(?<=\.) (?=[A-Z])", said, maxsplit=1)[0]
