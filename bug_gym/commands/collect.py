"""`bug-gym collect`: datasets of what policies do, for Minari."""

from __future__ import annotations

import argparse
import shlex

from bug_gym.commands.arguments import add_overrides, add_trust, assignments, policy_entries, policy_entry, told_path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", metavar="SCENARIO", help="name or path of a scenario")
    parser.add_argument(
        "--policies", required=True, help="NAME[:PARAMETER=VALUE...],...; of several also a mixed dataset"
    )
    parser.add_argument("--episodes", type=int, default=1000, help="worlds, an episode of each policy (default: 1000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first world (default: 0)")
    parser.add_argument(
        "--observations", default="dict,flat", help="how they lie, a dataset each: dict, flat (default: both)"
    )
    parser.add_argument("--modes", action="store_true", help="record the policy's state at each decision")
    parser.add_argument("--shortest-path", action="store_true", help="record the length of each world's shortest path")
    parser.add_argument("--expert", help="policy whose mean return is the highest score (default: hd_bug_map)")
    parser.add_argument("--author", help="who collects (default: the authors of bug_gym)")
    parser.add_argument("--author-email", help="where to write to")
    parser.add_argument("--code-permalink", help="address of the code, of this very version")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: 1)")
    parser.add_argument(
        "--out",
        type=told_path,
        required=True,
        help="folder of all datasets (MINARI_DATASETS_PATH); goes on where cut off",
    )
    add_overrides(parser)
    add_trust(parser)


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.evaluation.collection import Signature, collect  # loads the compiler
    from bug_gym.evaluation.demonstrations import Extras  # loads the compiler
    from bug_gym.evaluation.minari_files import require_minari  # loads the compiler
    from bug_gym.evaluation.reference_returns import EXPERT  # loads the compiler

    require_minari()
    names = collect(
        options.scenario,
        policy_entries(options.policies),
        options.out,
        episodes=options.episodes,
        seed=options.seed,
        forms=[form.strip() for form in options.observations.split(",")],
        extras=Extras(options.modes, options.shortest_path),
        expert=policy_entry(options.expert) if options.expert else EXPERT,
        signature=Signature(options.author, options.author_email, options.code_permalink),
        overrides=assignments(options.overrides),
        workers=options.workers,
        progress=True,
        trust=options.trust,
    )
    for name in names:
        print(name)
    print(f"MINARI_DATASETS_PATH={shlex.quote(str(options.out.absolute()))} lets Minari find them")
