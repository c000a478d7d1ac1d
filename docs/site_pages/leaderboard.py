"""The leaderboard: entries of docs/results/board, each with its command, commit, seeds and intervals."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from make_results import command
from result_pages.words import number, percent

from bug_gym.config import load
from site_pages import Pages
from site_pages.markup import paragraphs, table
from site_pages.numbers import BOARD, RESULTS, fares

HEAD = """# Leaderboard

Policies in the same worlds, by the share of them that they reach. Every line has the command that makes it, the commit that
it was made at, the seeds of its worlds and the 95 % interval (Wilson) of its success: lines whose intervals overlap are not
told apart by so few worlds, nor lines of two versions of the worlds. Ties are ordered by SPL, success weighted by the
shortest path over the path.
"""

HOW = """## Add yours

1. Drive your policy through the worlds of the board; nothing in it needs a place in the package:

   ```bash
   bug-gym evaluate COMMAND --policies my_bug.py:MyBug --out my_bug
   python docs/make_entry.py my_bug --name my_bug --code https://example.org/my_bug
   ```

   The second line writes `docs/results/board/my_bug.json`: what was asked (scenarios, seeds, versions), the summary and the
   commit of your checkout, and no line that it could not read in the folder of the evaluation.
2. Open a pull request with that file, and say what the policy senses, what it knows of the world beforehand, and, of a
   learned one, which seeds it was trained on (those below 2^40 are held out). The rows stay with you; the review runs the
   command again.

Policies that read the map are marked: they know more than the others.
"""

SCENARIOS = ("static", "dynamic", "moving_target", "rush", "crowd", "maze")
"""The worlds of the board."""
EPISODES = 100
"""How many of each, from seed 0."""
COMMAND = f"{' '.join(f'--scenario {name}' for name in SCENARIOS)} --episodes {EPISODES}"


def pages() -> Pages:
    """The page of the leaderboard."""
    entries = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(BOARD.glob("*.json"))]
    parts = [HEAD]
    for scenario in SCENARIOS:
        parts += [f"## {scenario}", board(scenario, entries)]
    parts += ["## Where the lines come from", sources(entries), HOW.replace("COMMAND", COMMAND), others()]
    return {"leaderboard.md": paragraphs(*parts)}


def lines_of(scenario: str, entries: list[dict[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Entries and their lines in a scenario, the best first."""
    found = [(entry, one) for entry in entries for one in entry["summaries"] if one["scenario"] == scenario]
    return sorted(found, key=lambda pair: (-pair[1]["success"], -(pair[1]["spl"] or 0.0), pair[1]["policy"]))


def board(scenario: str, entries: list[dict[str, Any]]) -> str:
    """The table of a scenario."""
    rows, today = [], load(scenario).digest
    for place, (entry, one) in enumerate(lines_of(scenario, entries), start=1):
        policy = f"`{one['policy']}`{' (reads the map)' if one['policy'] in entry['privileged'] else ''}"
        policy += "" if entry["digests"][scenario] == today else " (in worlds of an earlier version)"
        reached = f"{percent(one['success'])} ({100 * one['success_low']:.1f} - {100 * one['success_high']:.1f})"
        seeds = entry["seeds"][scenario]
        rows.append([
            str(place), policy, reached, number(one["spl"], 3), number(one["time"], 1), percent(one["collision"]),
            f"{seeds['first']} - {seeds['first'] + seeds['count'] - 1}", f"[{entry['name']}](#{slug(entry['name'])})",
        ])  # fmt: skip
    header = ["", "policy", "reached [%] (95 %)", "SPL", "time [s]", "collision [%]", "seeds", "entry"]
    return table(header, rows)


def slug(name: str) -> str:
    """The anchor of an entry's heading."""
    return f"entry-{name.replace('_', '-')}"


def sources(entries: list[dict[str, Any]]) -> str:
    """Command and commit of each entry."""
    parts = []
    for entry in entries:
        told = f"({slug(entry['name'])})=\n### {entry['name']}\n\n"
        told += f"{entry['about']} Commit `{entry['commit']}`, " if entry["about"] else f"Commit `{entry['commit']}`, "
        told += f"bug_gym {entry['versions']['bug_gym']}, Python {entry['versions']['python']}."
        code = f" Code: <{entry['code']}>" if entry["code"] else ""
        parts.append(f"{told}{code}\n\n```bash\n{entry['command']}\n```")
    return "\n\n".join(parts)


def others() -> str:
    """The other results that have a success in them, by the command that makes each."""
    told = fares()
    rows = []
    for name in dict.fromkeys(fare.result for fare in told):
        found = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
        mine = [fare for fare in told if fare.result == name]
        policies, worlds = ({getattr(fare, part) for fare in mine} for part in ("policy", "worlds"))
        counts = [str(len(policies)), str(len(worlds)), told_range(fare.n for fare in mine)]
        rows.append([f"[{name}](results/{name}.md)", *counts, f"`{found['commit'][:12]}`", f"`{command(name)}`"])
    header = ["result", "policies", "kinds of worlds", "worlds of each", "commit", "command"]
    return (
        "## Tables of papers, and larger ones\n\nEach has worlds of its own, whose seeds its command fixes; they are not one "
        f"board.\n\n{table(header, rows)}"
    )


def told_range(counts: Iterable[int]) -> str:
    """Least and greatest of some counts, or the one that they are."""
    different = sorted({*counts})
    return f"{different[0]} - {different[-1]}" if len(different) > 1 else str(different[0])
