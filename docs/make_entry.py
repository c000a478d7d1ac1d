"""Writes an entry of the leaderboard out of a results folder: `python docs/make_entry.py FOLDER --name NAME`.

The folder is what `bug-gym evaluate --out FOLDER` wrote. Numbers are read there, the commit is that of the checkout whose
code has made them.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

from bug_gym.config import load
from bug_gym.evaluation.by_name import policy_words
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.plan import SOURCE
from bug_gym.evaluation.summary import PRIVILEGED
from bug_gym.files import commit
from bug_gym.references import source_digest

BOARD = Path(__file__).parent / "results" / "board"


def entry(folder: Path, name: str, made_at: str, *, about: str = "", code: str = "") -> dict[str, Any]:
    """The entry of a results folder.

    Args:
        folder: what `bug-gym evaluate --out` wrote.
        name: what the board calls it: letters, digits and `_`.
        made_at: commit of the checkout that ran it.
        about: a sentence about it.
        code: where the policy's code is published.

    Raises:
        ValueError: a name that cannot be one, a folder without an evaluation, or one with rows missing, of worlds that are not
            the package's, or that no one command drives.
    """
    if not re.fullmatch(r"\w+", name):
        raise ValueError(f"got {name!r} as the name of an entry, expected letters, digits and _")
    if not (folder / "manifest.json").is_file() or not (folder / "summary.json").is_file():
        raise ValueError(
            f"{folder}: expected what `bug-gym evaluate --out` writes, with manifest.json and summary.json"
        )
    manifest, found = (
        json.loads((folder / f"{one}.json").read_text(encoding="utf-8")) for one in ("manifest", "summary")
    )
    for label, one in manifest["scenarios"].items():
        if one["digest"] != load(label).digest:
            expected = f"expected the scenario {label} as it is (no --set, no file of that name, no earlier version)"
            raise ValueError(f"{folder}: {label} was driven with other values, {expected}")
    summaries = [one for one in found["summaries"] if one["scenario"] != "(all)"]
    for one in summaries:
        count = manifest["scenarios"][one["scenario"]]["seeds"]["count"]
        if one["n"] != count:
            raise ValueError(f"{folder}: {one['policy']} has {one['n']} of {count} worlds of {one['scenario']}")
    return {
        "name": name,
        "about": about,
        "code": code,
        "command": command(manifest, name),
        "commit": made_at,
        "versions": manifest["versions"],
        "seeds": {label: one["seeds"] for label, one in manifest["scenarios"].items()},
        "digests": {label: one["digest"] for label, one in manifest["scenarios"].items()},
        "policies": manifest["policies"],
        "privileged": [label for label in manifest["policies"] if label.endswith(PRIVILEGED)],
        "summaries": summaries,
    }


def command(manifest: dict[str, Any], name: str) -> str:
    """The line that runs it again.

    Raises:
        ValueError: there is none.
    """
    seeds = {label: (one["seeds"]["first"], one["seeds"]["count"]) for label, one in manifest["scenarios"].items()}
    if len({*seeds.values()}) > 1:
        told = ", ".join(f"{count} of {label} from {first}" for label, (first, count) in seeds.items())
        raise ValueError(f"got other numbers of worlds by scenario ({told}), expected the same seeds of all")
    first, count = next(iter(seeds.values()))
    policies = []
    for label, one in manifest["policies"].items():
        words = policy_words(PolicyEntry(label, one["name"], one["parameters"]))
        if not words:
            raise ValueError(f"policy {label} has parameters that no command can say")
        policies.append(words)
    scenarios = " ".join(f"--scenario {label}" for label in seeds)
    asked = f"--episodes {count}{f' --seed {first}' if first else ''} --policies {','.join(policies)}"
    return f"bug-gym evaluate {scenarios} {asked} --out {name}"


def require_own_code(folder: Path) -> None:
    """Refuse rows that other code than this has made: the commit would not be theirs.

    Raises:
        ValueError: they are.
    """
    path = folder / "manifest.json"
    made_by = json.loads(path.read_text(encoding="utf-8"))["versions"].get(SOURCE) if path.is_file() else None
    if made_by is not None and made_by != source_digest()[:16]:
        raise ValueError(
            f"{folder}: other source of bug_gym has made its rows, say which with --commit, or evaluate again"
        )


def main(arguments: list[str]) -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="what bug-gym evaluate --out wrote")
    parser.add_argument("--name", required=True, help="what the board calls it")
    parser.add_argument("--about", default="", help="a sentence about it")
    parser.add_argument("--code", default="", help="where the policy's code is published")
    parser.add_argument("--commit", help="of the checkout that ran it (default: the present one)")
    options = parser.parse_args(arguments)
    try:
        if options.commit is None:
            require_own_code(options.folder)
        made_at = options.commit or commit()
        made = entry(options.folder, options.name, made_at, about=options.about, code=options.code)
    except ValueError as error:
        parser.error(str(error))
    BOARD.mkdir(exist_ok=True)
    path = BOARD / f"{options.name}.json"
    path.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
