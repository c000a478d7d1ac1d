"""Writes an entry of the leaderboard out of a results folder: `python docs/make_entry.py FOLDER --name NAME`.

The folder is what `bug-gym evaluate --out FOLDER` wrote. Numbers are read there, the commit is that of the checkout.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from bug_gym.evaluation.summary import PRIVILEGED

BOARD = Path(__file__).parent / "results" / "board"


def entry(folder: Path, name: str, commit: str, *, about: str = "", code: str = "") -> dict[str, Any]:
    """The entry of a results folder.

    Args:
        folder: what `bug-gym evaluate --out` wrote.
        name: what the board calls it: letters, digits and `_`.
        commit: of the checkout that ran it.
        about: a sentence about it.
        code: where the policy's code is published.

    Raises:
        ValueError: a name that cannot be one, a folder without an evaluation, or one with rows missing.
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
        "commit": commit,
        "versions": manifest["versions"],
        "seeds": {label: one["seeds"] for label, one in manifest["scenarios"].items()},
        "digests": {label: one["digest"] for label, one in manifest["scenarios"].items()},
        "policies": manifest["policies"],
        "privileged": [label for label in manifest["policies"] if label.endswith(PRIVILEGED)],
        "summaries": summaries,
    }


def command(manifest: dict[str, Any], name: str) -> str:
    """The line that runs it again."""
    (seeds,) = {(one["seeds"]["first"], one["seeds"]["count"]) for one in manifest["scenarios"].values()}
    scenarios = " ".join(f"--scenario {label}" for label in manifest["scenarios"])
    options = [
        ":".join([one["name"], *(f"{key}={value}" for key, value in one["parameters"].items())])
        for one in manifest["policies"].values()
    ]
    first = f" --seed {seeds[0]}" if seeds[0] else ""
    return f"bug-gym evaluate {scenarios} --episodes {seeds[1]}{first} --policies {','.join(options)} --out {name}"


def main(arguments: list[str]) -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="what bug-gym evaluate --out wrote")
    parser.add_argument("--name", required=True, help="what the board calls it")
    parser.add_argument("--about", default="", help="a sentence about it")
    parser.add_argument("--code", default="", help="where the policy's code is published")
    parser.add_argument("--commit", help="of the checkout that ran it (default: the present one)")
    options = parser.parse_args(arguments)
    commit = options.commit or subprocess.check_output(["git", "rev-parse", "HEAD"], text=True).strip()
    made = entry(options.folder, options.name, commit, about=options.about, code=options.code)
    BOARD.mkdir(exist_ok=True)
    path = BOARD / f"{options.name}.json"
    path.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
