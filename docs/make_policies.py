"""Writes policies.md and the table of policies in the README: `python docs/make_policies.py`.

What is said of a policy is the docstring of its module; names, families and references are the table in
agents/__init__.py.
"""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.agents import AGENTS, TEAMS, parameter_names

ROOT = Path(__file__).resolve().parents[1]
PAGE, README = ROOT / "docs" / "policies.md", ROOT / "README.md"
BEGIN, END = "<!-- policies: made by docs/make_policies.py -->", "<!-- end of policies -->"
"""What the table in the README stands between."""

KINDS = {
    "floor": "floors: what nothing should do worse than",
    "bug": "the Bug family",
    "field": "potential fields",
    "mapper": "maps what it sees, and plans in it",
    "local": "local navigators",
    "reciprocal": "robots that avoid one another",
    "team": "teams of robots",
    "planner": "planners that are told the map",
    "learned": "learned by PPO, SAC and DQN",
}
"""What each family of policies is called in the README."""

HEAD = """# Policies

All policies have stable-baselines3's `predict`: `make_policy(name, env, **parameters)` makes one for the robot of any env,
`bug-gym list policies` names them. Each sees its observation and its own memory, never the world; but for the planners
that are privileged: they read the map of a live env as an episode begins, and what moves as it is now.

"Arrives always" is the guarantee in its docstring. It holds in still worlds without gaps between twice the body's radius
and twice the clearance. An algorithm that finds its goal shut in says so (`memory.verdict`: "unreachable"), one that finds
itself going in circles too ("looping", "stuck"). A lap in which something near was seen to move proves nothing: then
another one begins. Among gaps that are hardly one the hand may come to another wall: a bug that arrives always and has gone
round twice in vain begins anew from there, at most three times: as a thinner robot, for which such a gap is one from both
sides. Each time it keeps two thirds of what it kept beside its body before, and no less than its brake and noise need.

A planner that has the map says "unreachable" where the body itself is stopped, and "stuck" where only its cells or its
margin leave no way.

Common parameters: `clearance` (centre to wall [m]), `turn` ("left", "right"), `leave_rule` ("front": a heading is free only
within 90 degrees of the direction of travel; "any").

Every bug on one map, `bug-gym gallery --set 'world.bounds=[-3,-14,31,13]' --set world.start=A --set world.goal=D --set
lidar.range=40`, and on their way (`--gif gallery.gif --size 200`):

![Every bug on the map of Oni and Wang](gallery.png)

![Every bug on its way on the map of Oni and Wang](gallery.gif)

This page is made by `python docs/make_policies.py` from the table in `agents/__init__.py` and the docstrings of the
modules.
"""

REPORTS = """## What papers report, and what was found

"""
"""What stands above the table of reports."""

REPORT = re.compile(r"Reported(?:, (?P<by>[^:]*))?: (?P<reported>.*?) Found: (?P<found>.*)")
"""A paragraph of a docstring that says what a paper reports and what was found."""


class Entry(NamedTuple):
    """One algorithm of the table."""

    names: list[str]
    """The names that play it, the usual one first."""
    family: str
    reference: str
    module: Any
    """Its module."""
    policy_class: type
    is_privileged: bool


def entries() -> list[Entry]:
    """The algorithms in the order of the table; what plays models comes once, with all of them."""
    found: dict[str, Entry] = {}
    for name, agent in (AGENTS | TEAMS).items():
        if agent.entry_point in found:
            entry = found[agent.entry_point]
            entry.names.append(name)
            if agent.model and agent.reference not in entry.reference:
                found[agent.entry_point] = entry._replace(reference=f"{entry.reference}; {agent.reference}")
            continue
        module_name, class_name = agent.entry_point.split(":")
        module = importlib.import_module(f"bug_gym.agents.{module_name}")
        policy_class = getattr(module, class_name)
        found[agent.entry_point] = Entry([name], agent.family, agent.reference, module, policy_class, agent.privileged)
    return list(found.values())


def summary(entry: Entry) -> str:
    """The first sentence of the docstring, without the name it begins with."""
    first = " ".join(str(entry.module.__doc__).split("\n\n")[0].split()).rstrip(".")
    name, colon, rest = first.partition(": ")
    return rest if colon and entry.family in ("bug", "planner") else first


def arrives_always(entry: Entry) -> str:
    """Whether the docstring guarantees the goal, or the news that there is no way to it."""
    told = re.search(r"Guarantee:\s+(.*?)(?:[.;]\s|\Z)", str(entry.module.__doc__), re.DOTALL)
    return "yes" if told and "reaches the goal" in " ".join(told[1].split()) else "no"


def names_of(entry: Entry) -> str:
    """The usual name as code, others in brackets; models side by side."""
    usual, *others = (f"`{name}`" for name in entry.names)
    if entry.family == "learned":
        return ", ".join((usual, *others))
    return usual + (f" ({', '.join(others)})" if others else "")


def table() -> str:
    """The table in the README: a kind a row."""
    kinds: dict[str, tuple[list[str], list[str]]] = {}
    for entry in entries():
        sure, others = kinds.setdefault(entry.family, ([], []))
        (sure if arrives_always(entry) == "yes" else others).append(names_of(entry))
    rows = [[KINDS[kind], ", ".join(sure) or "-", ", ".join(others) or "-"] for kind, (sure, others) in kinds.items()]
    lines = [["kind", "arrive always, or tell that there is no way", "the others"], ["---"] * 3, *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def overview() -> str:
    """The table at the top of the page: a policy a row."""
    rows = [[names_of(entry), summary(entry), arrives_always(entry), entry.reference] for entry in entries()]
    lines = [["name", "what it does", "arrives always", "source"], ["---"] * 4, *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def reports() -> str:
    """The table of what papers report and what was found, of the modules whose docstrings say so."""
    rows = []
    for entry in entries():
        for paragraph in str(entry.module.__doc__).split("\n\n"):
            told = REPORT.fullmatch(" ".join(paragraph.split()))
            if told:
                by = f" ({told['by']})" if told["by"] else ""
                rows.append([names_of(entry), told["reported"].rstrip(".") + by, told["found"]])
    lines = [["name", "reported", "found here, and what was repaired"], ["---"] * 3, *rows]
    return REPORTS + "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def section(entry: Entry) -> str:
    """What the page says of an algorithm."""
    text = str(entry.module.__doc__).strip()
    path = Path(entry.module.__file__).resolve().relative_to(ROOT).as_posix()
    facts = [
        f"family: {entry.family}",
        f"source: {entry.reference}",
        f"arrives always: {arrives_always(entry)}",
        f"file: [{path}](../{path})",
    ]
    if entry.is_privileged:
        facts.append("privileged: is given the map")
    own = [f"`{name}`" for name in parameter_names(entry.policy_class) if name != "model" or entry.family != "learned"]
    if own:
        facts.insert(3, f"parameters: {', '.join(own)}")
    return "\n\n".join([f"## {names_of(entry)}", text, "\n".join(f"- {fact}" for fact in facts)]) + "\n"


def page() -> str:
    """The text of policies.md."""
    return "\n".join([HEAD, overview(), reports(), *map(section, entries())])


def readme(text: str) -> str:
    """The README with its table written anew."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    README.write_text(readme(README.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"{PAGE} and the table in {README}\n")
