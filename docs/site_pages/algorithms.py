"""A page a policy, out of its docstring, its table of parameters, its source and docs/results."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import MISSING
from functools import cache
from pathlib import Path

from make_policies import KINDS, ROOT, Entry, arrives_always, entries, names_of, reports, summary
from result_pages.words import number, percent

from bug_gym.agents import AGENTS
from bug_gym.agents.parameters import Parameter, parameters_of
from site_pages import Pages
from site_pages.markup import one_line, paragraphs, prose, table, toctree
from site_pages.numbers import Fare, fares

LABELS = ("Source", "Sensing assumed", "Told", "Memory kept", "States", "Guarantee", "Length bound", "Length")
"""What the paragraph of facts of a docstring is divided by."""

FACTS = re.compile(rf"(?:^|(?<=[.;] ))({'|'.join(LABELS)}): ")

IDEAS = Path(__file__).with_name("ideas.md")
"""A heading of names, five sentences and pseudocode for each policy."""
IDEA = re.compile(r"(?P<names>[^\n]*)\n\n(?P<text>.*?)\n\n(?P<pseudocode>```text\n.*```)\s*", re.DOTALL)
SYMBOLS = (
    "x is the robot, T the goal, |xT| the distance between them; a lap is once round the obstacle that is followed."
)
"""What pseudocode takes for known."""

TITLES = {**KINDS, "local": "local navigators", "floor": "floors"}

HEAD = """# Policies

All policies have stable-baselines3's `predict`: `make_policy(name, env, **parameters)` makes one for the robot of any env.
Each sees its observation and its own memory, never the world; planners that are privileged also read the map of a live env as
an episode begins.

"Arrives always" is the guarantee in its docstring. It holds in still worlds without gaps between twice the body's radius and
twice the clearance. An algorithm that finds its goal shut in says so (`memory.verdict`: "unreachable"), one that finds itself
going in circles too ("looping", "stuck"). How to write one: [guide](../guide/policies.md).

![Every bug on its way on the map of Oni and Wang](../gallery.gif)
"""


def pages(captions: Mapping[str, str]) -> Pages:
    """The pages of all policies and their index.

    Args:
        captions: what the films show, by the first name of the policy; a page without one has no film.
    """
    everything, told = one_a_model(), fares()
    made = {f"algorithms/{entry.names[0]}.md": page(entry, told, captions) for entry in everything}
    return {"algorithms/index.md": index(everything), **made}


def one_a_model() -> list[Entry]:
    """The algorithms in the order of their table; of the learned ones each model is one."""
    found = []
    for entry in entries():
        if entry.family == "learned":
            found += [entry._replace(names=[name], reference=AGENTS[name].reference) for name in entry.names]
        else:
            found.append(entry)
    return found


def index(everything: list[Entry]) -> str:
    """All policies by kind, each with its sentence."""
    parts = [HEAD]
    for kind in dict.fromkeys(entry.family for entry in everything):
        rows = [
            [f"[{names_of(entry)}]({entry.names[0]}.md)", prose(idea(entry)), arrives_always(entry), entry.reference]
            for entry in everything
            if entry.family == kind
        ]
        header = ["name", "what it does", "arrives always", "source"]
        parts += [f"## {TITLES[kind][0].upper()}{TITLES[kind][1:]}", table(header, rows)]
    return paragraphs(*parts, reports(), toctree(entry.names[0] for entry in everything))


def idea(entry: Entry) -> str:
    """What a policy does, in a sentence without its end; of a model, what it was trained by and in."""
    if entry.family != "learned":
        return summary(entry)
    told = dict(re.findall(r"^- (Task|Algorithm): (.*)$", card(entry.names[0]), re.MULTILINE))
    return f"{told['Algorithm'].partition(' ')[0]}, trained in {told['Task']}"


def page(entry: Entry, told: list[Fare], captions: Mapping[str, str]) -> str:
    """The page of a policy."""
    name = entry.names[0]
    first, facts, rest = parts_of(str(entry.module.__doc__))
    shown = f"![{name}]({name}.gif)\n\n*{captions[name]}*" if name in captions else ""
    more = "\n\n".join(map(prose, rest))
    if name not in ideas():
        raise ValueError(f"{IDEAS.name} says nothing of {name}: expected its idea and pseudocode")
    told_idea, pseudocode = ideas()[name]
    return paragraphs(
        f"# {names_of(entry)}",
        prose(first) if entry.family != "learned" else f"{idea(entry)}. {prose(first)}",
        shown,
        f"## The idea\n\n{told_idea}\n\n{pseudocode}\n\n{SYMBOLS}",
        table(["", ""], [[f"**{label}**", prose(text)] for label, text in about(entry, facts).items()]),
        f"## More about it\n\n{more}" if more else "",
        f"## How to play it\n\n{how_to_play(entry)}",
        f"## Parameters\n\n{parameters(entry)}",
        f"## How it fares\n\n{how_it_fares(entry, told)}",
        f"## A decision\n\n{decision(entry)}" if entry.family != "learned" else f"## Its making\n\n{card(name)}",
    )


@cache
def ideas() -> dict[str, tuple[str, str]]:
    """The five sentences and the pseudocode of each policy, by its first name; models of one kind share them.

    Raises:
        ValueError: a heading without both below it.
    """
    found = {}
    for part in re.split(r"^## ", IDEAS.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        match = IDEA.fullmatch(part)
        if match is None:
            raise ValueError(f"expected sentences and pseudocode in {IDEAS.name}, got {part!r}")
        found.update(dict.fromkeys(match["names"].split(", "), (match["text"], match["pseudocode"])))
    return found


def parts_of(docstring: str) -> tuple[str, dict[str, str], list[str]]:
    """A docstring's first paragraph, its facts by their labels, and its other paragraphs."""
    first, *others = inspect.cleandoc(docstring).split("\n\n")
    facts: dict[str, str] = {}
    rest = []
    labels = [one[1] for paragraph in others for one in FACTS.finditer(one_line(paragraph))]
    two_algorithms = len(labels) > len({*labels})  # of one name: each keeps its facts in its text
    for paragraph in others:
        text = one_line(paragraph)
        found = list(FACTS.finditer(text))
        if not found or two_algorithms:
            rest.append(paragraph)
            continue
        if text[: found[0].start()].strip():
            rest.append(text[: found[0].start()].strip())
        for one, following in zip(found, [*found[1:], None], strict=True):
            facts[one[1]] = text[one.end() : following.start() if following else None].strip()
    return one_line(first), facts, rest


def about(entry: Entry, facts: Mapping[str, str]) -> dict[str, str]:
    """What the table at the top says: the docstring's facts, and what the table of agents knows."""
    said = {"Names": names_of(entry), "Kind": TITLES[entry.family], **facts}
    said.setdefault("Source", entry.reference)
    if entry.reference not in ("-", "this package") and "Source" in facts:
        said["Reference"] = entry.reference
    said["Arrives always"] = arrives_always(entry)
    if entry.is_privileged:
        said["Privileged"] = "yes: it is given the map"
    return said


def how_to_play(entry: Entry) -> str:
    """The lines that make it, on the command line and in Python."""
    name = entry.names[0]
    where = (
        "oni_wang_pair" if entry.family == "team" else "crossing_robots" if entry.family == "reciprocal" else "static"
    )
    env = f'bug_gym.parallel_env("{where}", robots=2)' if where != "static" else 'gym.make("BugGym/Static-v0")'
    code = f'policy = make_policy("{name}", {env})'
    run = f"bug-gym evaluate --scenario {where} --policies {name} --episodes 20\n"
    film = f"bug-gym render {name} {where} --out {name}.gif"
    return f"```bash\n{run}{film}\n```\n\n```python\n{code}\n```"


def parameters(entry: Entry) -> str:
    """The table of its parameters."""
    rows = [
        [f"`{one.name}`", f"`{one.type}`", default_of(one), prose(one.text)]
        for one in parameters_of(entry.policy_class)
        if not (one.name == "model" and entry.family == "learned")
    ]
    return table(["name", "takes", "default", "meaning"], rows) if rows else "None."


def default_of(one: Parameter) -> str:
    """What a parameter is if nothing is given."""
    return "needed" if one.default in (MISSING, inspect.Parameter.empty) else f"`{one.default!r}`"


def how_it_fares(entry: Entry, told: list[Fare]) -> str:
    """Its lines of the results, each with the page that it comes from."""
    rows = [
        [
            f"[{fare.result}](../results/{fare.result}.md)",
            fare.worlds,
            ", ".join(filter(None, [f"`{fare.policy}`" if len(entry.names) > 1 else "", fare.variant])),
            str(fare.n),
            f"{percent(fare.success)} ({100 * fare.low:.1f} - {100 * fare.high:.1f})",
            number(fare.path_ratio),
            number(fare.time, 1),
        ]
        for fare in told
        if fare.policy in entry.names
    ]
    if not rows:
        return "No table of [results](../results/README.md) has its success in worlds of one kind yet."
    header = ["result", "worlds", "variant", "number", "reached [%] (95 %)", "path / shortest", "time [s]"]
    return (
        f"{table(header, rows)}\n\nPaths and times are means over the worlds reached. Each result's page has its command, "
        "its commit and what else was measured; results with few worlds say little, as their intervals show."
    )


def decision(entry: Entry) -> str:
    """The method that decides, as it stands in the code."""
    method = next(getattr(entry.policy_class, name) for name in METHODS if hasattr(entry.policy_class, name))
    code = inspect.cleandoc(inspect.getsource(method))
    where = f"{method.__module__}.{method.__qualname__}"
    return f"`{where}`:\n\n```python\n{code}\n```"


def card(name: str) -> str:
    """What is kept beside the weights of a model, without its heading."""
    text = (ROOT / "agents" / "trained" / name / "card.md").read_text(encoding="utf-8")
    return text.partition("\n\n")[2]


METHODS = ("act", "plan", "predict")
"""What decides, in the order in which a policy is looked at."""
