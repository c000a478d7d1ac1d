"""`bug-gym push`: a trained model onto the Hugging Face Hub, where `hf://user/name` plays it."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("model", metavar="MODEL", help="name or folder of a model of ours")
    parser.add_argument("place", metavar="hf://USER/NAME", help="where it goes; @BRANCH behind it for another branch")
    parser.add_argument(
        "--private", action="store_true", help="where the repository is made now, only its owner sees it"
    )


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.agents.learning.folder import model_folder  # loads pydantic
    from bug_gym.agents.learning.publishing import push  # loads pydantic

    address = push(model_folder(options.model), options.place, private=options.private)
    print(f"{address}: play it with --policies {options.place}")
