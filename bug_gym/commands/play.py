"""`bug-gym play`: drive a robot by hand, beside policies in the same world where one likes."""

from __future__ import annotations

import argparse

from bug_gym.commands.arguments import add_scenario, assignments, policy_entries, told_path
from bug_gym.files import writable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--against", metavar="POLICIES", help="NAME[:PARAMETER=VALUE...],... that race in the same world beside you"
    )
    parser.add_argument(
        "--record", type=told_path, metavar="FILE", help="a .json of all you drive; `bug-gym watch` plays it"
    )


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.config import load  # loads pydantic
    from bug_gym.drawing.screen import Screen  # loads the compiler
    from bug_gym.evaluation.driven import JSON  # loads the compiler
    from bug_gym.evaluation.entries import PolicyEntry  # loads the compiler
    from bug_gym.evaluation.live import KEYS, Hand, Show, run, same_world  # loads the compiler

    path = None if options.record is None else writable(options.record, [JSON])
    scenario = load(options.scenario, assignments(options.overrides), trust=options.trust)
    hand = Hand(scenario, path)
    rivals = policy_entries(options.against) if options.against else []
    worlds = same_world([PolicyEntry.of(("you", hand)), *rivals], scenario)
    show = Show(worlds, first=options.seed, size=options.size)
    screen = Screen()
    print(f"Arrows, w a s d, the mouse button held or a pad drive, shift slows down; {KEYS}.")
    try:
        run(show, screen, print, hand)
    finally:
        screen.close()
    if path is not None and hand.episodes:
        print(f"{path}: {len(hand.episodes)} driven; `bug-gym watch {path}` plays it")
