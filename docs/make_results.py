"""Writes the pages of results: `python docs/make_results.py`.

A page for each reproduction and each of the long checks, out of docs/results/NAME.json, and an index. What a page asks is
the docstring of the module that made its JSON, what it says stands in docs/result_pages; every number there is looked up
in the JSON or, of trained models, in the record beside their weights. Claims are checked again; a JSON that says otherwise
of itself is an error.
"""

from __future__ import annotations

import ast
import importlib
import json
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from result_pages import (
    Page,
    Record,
    bug_family,
    crowds,
    hd_bug,
    learning,
    long_checks,
    planners,
    potential_field,
    tracking,
    triangulation,
)
from result_pages.words import code, table

from bug_gym.files import released
from bug_gym.reproductions import REPRODUCTIONS

RESULTS = Path(__file__).parent / "results"

PAGES: dict[str, Callable[[Record], Page]] = {
    "oni-wang-table-1": bug_family.oni_wang_table_1,
    "bug-bounds": bug_family.bounds,
    "bug-no-way": bug_family.no_way,
    "ring-verdicts": bug_family.ring_verdicts,
    "cylinder-claims": bug_family.cylinder_claims,
    "still-things": bug_family.still_things,
    "com1-rev3": bug_family.com1_rev3,
    "barn": bug_family.barn_worlds,
    "dynabarn": bug_family.dynabarn_worlds,
    "lidar-density": bug_family.lidar_density,
    "odometry-drift": bug_family.drift,
    "operative-critical-points": bug_family.critical_points,
    "hd-bug-tables": hd_bug.tables,
    "hd-bug-dynamic": hd_bug.dynamic,
    "hd-bug-targets": hd_bug.targets,
    "hd-bug-traps": hd_bug.traps,
    "hd-bug-real": hd_bug.real,
    "hd-bug-ablation": hd_bug.ablation,
    "apf-wall-following": potential_field.apf_wall_following,
    "circle-swap": crowds.circle_swap,
    "learned": learning.learned,
    "ppo-curve": learning.ppo_curve,
    "offline": learning.offline_learning,
    "predictors": learning.predictor_errors,
    "tracking": tracking.tracks,
    "scripted-and-learned": learning.side_by_side,
    "navigator": hd_bug.navigator_in_all_kinds,
    "price-of-not-knowing": planners.price_of_not_knowing,
    "d2t-eaco": triangulation.d2t_eaco,
    "soak": long_checks.soak,
    "cluster": long_checks.cluster,
    "oracle": long_checks.oracle,
}
"""Name of a reproduction or a check -> what its page says."""

ROOT = Path(__file__).parents[1]
CHECKS = {
    "soak": ROOT / "tests" / "soak.py",
    "cluster": ROOT / "docs" / "measure_cluster.py",
    "oracle": ROOT / "tests" / "oracle.py",
}
"""Name of a check -> the script that it is."""

WITH_DATA = (
    *(
        "barn",
        "dynabarn",
        "hd-bug-real",
        "predictors",
        "tracking",
        "scripted-and-learned",
        "price-of-not-knowing",
        "d2t-eaco",
    ),
)
"""Reproductions that were given somebody else's data."""

MADE = "by `python docs/make_results.py`; its sentences stand in docs/result_pages."


def command(name: str) -> str:
    """What runs a reproduction or a check."""
    if name in CHECKS:
        script = CHECKS[name].relative_to(ROOT).as_posix()
        return "make soak" if name == "soak" else f"python {script} --out docs/results/{name}.json"
    return f"bug-gym reproduce {name}{' --data PATH' if name in WITH_DATA else ''} --out docs/results/{name}.json"


def asked(name: str) -> tuple[str, str]:
    """The first sentence of the docstring of a reproduction or a check, and the rest of it."""
    if name in CHECKS:
        said = ast.get_docstring(ast.parse(CHECKS[name].read_text(encoding="utf-8")))
    else:
        said = importlib.import_module(f"bug_gym.reproductions.{REPRODUCTIONS[name]}").__doc__
    first, _, rest = str(said).strip().partition("\n\n")
    return " ".join(first.split()), rest


def verdict(holds: bool | None) -> str:
    """What came of the claims of a reproduction."""
    return {True: "true", False: "**false**", None: "claims nothing"}[holds]


def made_again(found: Record) -> str:
    """Which policies' rows were made at other commits than all others."""
    at: dict[str, list[str]] = {}
    for policy, commit in found.get("made_again", {}).items():
        at.setdefault(commit, []).append(f"`{policy}`")
    told = [f"{', '.join(policies)}: made at commit `{commit}`" for commit, policies in at.items()]
    return f"{'; '.join(told)}; all others at the one above." if told else ""


def page(name: str, found: Record) -> str:
    """The page of a reproduction or a check.

    Raises:
        ValueError: its claims, checked again, are not what the JSON says of itself.
    """
    told = PAGES[name](found)
    holds = all(true for _, true in told.claims) if told.claims else None
    if holds != found["holds"]:
        raise ValueError(f"{name}: the JSON says {found['holds']!r} of its claims, its numbers say {holds!r}")
    first, rest = asked(name)
    release = released(found["bug_gym"])
    again = f" The same were found at commit `{found['confirmed']}`, but for times." if "confirmed" in found else ""
    if "times_of" in found:
        newer = f", but for those of {code(found['new_times'])}" if "new_times" in found else ""
        again += f" Times of decisions and plans are those of commit `{found['times_of']}`{newer}."
    made = (
        f"Numbers: [{name}.json]({name}.json), made at commit `{found['commit']}` with bug_gym {release} and "
        f"Python {found['python']}.{again} This page is made of it {MADE}"
    )
    claims = table("Claims", ["claim", "found"], [[claim, verdict(true)] for claim, true in told.claims])
    parts = [
        f"# {name}", first, rest, f"```bash\n{command(name)}\n```", made, made_again(found), found.get("remark", ""),
        claims if told.claims else "It claims nothing.",
        "## What it says", told.reading, "## Numbers", *told.tables,
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def index(everything: Mapping[str, Record]) -> str:
    """The list of the pages."""

    def listing(title: str, names: Iterable[str]) -> str:
        rows = []
        for name in names:
            claims = PAGES[name](everything[name]).claims
            count = f"{sum(true for _, true in claims)} of {len(claims)} claims true" if claims else "claims nothing"
            rows.append([f"[{name}]({name}.md)", asked(name)[0], count])
        return table(title, ["name", "asks", "found"], rows).split("\n\n", 1)[1]

    return (
        "# Results\n\nWhat papers report and what this package claims, run again: a page each, with the command, the "
        "commit, the tables and what was found. A claim that was found false stands as false. `bug-gym list "
        "reproductions` names them. Somebody else's data (`--data`: the worlds of the BARN benchmark, recorded "
        "pedestrians, maps of ROS's map_server) is not part of this package.\n\n"
        "Networks and predictors are judged in worlds that neither training nor validation saw, the claims of HD-BUG in worlds "
        "from seed 10,000 on. Most other pages count from seed 0, where scripted policies were mended by what failed: a zero "
        "there says that nothing is known to fail, not how often something would in new worlds. A claim with a bar is about "
        "the number found, not about its interval, where it does not say so; intervals and p are not corrected for the number "
        "of comparisons, where a page does not say so.\n\n"
        f"These pages are made {MADE.replace('its', 'their')}\n\n"
        + listing("Reproductions", [name for name in everything if name not in CHECKS])
        + "\n\nChecks that take too long for each change, with the figures of their last run:\n\n"
        + listing("Checks", [name for name in everything if name in CHECKS])
        + "\n\nHow fast the package is: [speed](../speed.md). What was tried and not kept: [trials](../trials.md).\n"
    )


def pages() -> dict[str, str]:
    """Text by file name below docs/results."""
    everything = {
        name: json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
        for name in (*REPRODUCTIONS, *CHECKS)
        if (RESULTS / f"{name}.json").exists()
    }
    return {"README.md": index(everything), **{f"{name}.md": page(name, found) for name, found in everything.items()}}


if __name__ == "__main__":
    written = pages()
    for name, text in written.items():
        (RESULTS / name).write_text(text, encoding="utf-8")
    sys.stdout.write(f"{len(written)} pages in {RESULTS}\n")
