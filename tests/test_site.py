"""The pages of the site that are made when it is built: one for each policy, scenario and module; what they say is so.

The site itself is built by `make docs`, as a workflow of its own does for each change: its warnings are errors there, and each
link is followed.
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

import bug_gym
from bug_gym.agents import AGENTS, TEAMS
from bug_gym.config import load, scenario_names
from bug_gym.evaluation import evaluate

ROOT = Path(__file__).resolve().parents[1]
BOARD = sorted((ROOT / "docs" / "results" / "board").glob("*.json"))


@pytest.fixture(autouse=True, scope="module")
def beside_the_scripts() -> Iterator[None]:
    """A script finds what lies beside it, as when it is run."""
    sys.path.insert(0, str(ROOT / "docs"))
    yield
    sys.path.remove(str(ROOT / "docs"))


def part(name: str) -> Any:
    """A module of docs/."""
    return importlib.import_module(name)


@pytest.fixture(scope="module")
def policies(beside_the_scripts: None) -> Mapping[str, str]:
    made: Mapping[str, str] = part("site_pages.algorithms").pages({"bug2": "what is seen"})
    return made


@pytest.fixture(scope="module")
def scenarios(beside_the_scripts: None) -> Mapping[str, str]:
    made: Mapping[str, str] = part("site_pages.environments").pages({})
    return made


# ------------------------------------------------------------------------------------------------ policies


@pytest.mark.parametrize("name", [*AGENTS, *TEAMS])
def test_each_policy_has_its_page(name: str, policies: Mapping[str, str]) -> None:
    titles = [text.partition("\n")[0] for text in policies.values()]
    assert sum(f"`{name}`" in title for title in titles) == 1
    assert any(f"`{name}`" in line and "](" in line for line in policies["algorithms/index.md"].splitlines())


def test_each_part_of_a_page_is_there(policies: Mapping[str, str]) -> None:
    for place, text in policies.items():
        if place != "algorithms/index.md":
            headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
            assert {"How to play it", "Parameters", "How it fares"} <= {*headings}, place
            assert ("A decision" in headings) != ("Its making" in headings), place


def test_the_page_of_a_bug_says_what_its_docstring_says(policies: Mapping[str, str]) -> None:
    text = policies["algorithms/bug2.md"]
    assert "| **Guarantee** | reaches the goal or declares it unreachable. |" in text
    assert "| **States** | motion_to_goal, boundary_following. |" in text
    assert "| **Source** | Lumelsky and Stepanov (1987). |" in text
    assert "![bug2](bug2.gif)\n\n*what is seen*" in text
    assert "| `turn` | `'left' \\| 'right'` | `'left'` |" in text


def test_the_page_of_a_model_says_what_it_was_trained_by_and_in(policies: Mapping[str, str]) -> None:
    assert "\n\nPPO, trained in the scenario rush. " in policies["algorithms/ppo_rush.md"]
    assert "| DQN, trained in the scenario dynamic |" in policies["algorithms/index.md"]


def test_a_docstrings_signs_stand_as_they_are_and_headings_of_paragraphs_are_set() -> None:
    prose = part("site_pages.markup").prose
    assert prose("*Stop rule.* A robot <x> wins.\n\n*No way.* 2 * 3, `a*b`.") == (
        "*Stop rule.* A robot \\<x> wins.\n\n*No way.* 2 \\* 3, `a*b`."
    )
    assert prose("A* and D* go on. *x") == "A\\* and D\\* go on. \\*x"


def test_no_sentence_of_a_docstring_is_lost(policies: Mapping[str, str]) -> None:
    algorithms = part("site_pages.algorithms")
    for entry in algorithms.one_a_model():
        first, facts, rest = algorithms.parts_of(entry.module.__doc__)
        told = " ".join([first, *(f"{label}: {text}" for label, text in facts.items()), *rest])
        assert sorted(told.split()) == sorted(entry.module.__doc__.split()), entry.names


def test_each_policy_has_its_idea_in_five_sentences_and_pseudocode(policies: Mapping[str, str]) -> None:
    algorithms = part("site_pages.algorithms")
    names = [entry.names[0] for entry in algorithms.one_a_model()]
    assert sorted(algorithms.ideas()) == sorted(names)
    for name, (idea, pseudocode) in algorithms.ideas().items():
        sentences = re.split(r"(?<=[.;?]) (?=[A-Z0-9])", " ".join(idea.split()))
        assert len(sentences) == 5 and all(one.endswith(".") for one in sentences), name
        assert pseudocode.count("```") == 2 and pseudocode.count("\n") >= 3, name
        assert f"## The idea\n\n{idea}\n\n{pseudocode}" in policies[f"algorithms/{name}.md"]


def test_every_scripted_policy_has_a_source_and_a_guarantee(policies: Mapping[str, str]) -> None:
    for entry in part("site_pages.algorithms").one_a_model():
        if entry.family not in ("floor", "learned"):
            text = policies[f"algorithms/{entry.names[0]}.md"]
            assert "| **Source** |" in text, entry.names
            for fact in ("Guarantee", "States"):
                assert f"| **{fact}** |" in text or f" {fact}: " in text, entry.names


# ------------------------------------------------------------------------------------------------ scenarios and modules


@pytest.mark.parametrize("name", scenario_names())
def test_each_scenario_has_its_page_with_its_numbers(name: str, scenarios: Mapping[str, str]) -> None:
    text, scenario = scenarios[f"environments/{name}.md"], load(name)
    assert text.startswith(f"# {name}\n") and f"[{name}]({name}.md)" in scenarios["environments/index.md"]
    assert f"| `ranges` | ({scenario.lidar.beams},) |" in text
    assert f"| `lidar.range` | `{scenario.lidar.range}`" in text
    assert f"| `collision` | {scenario.reward.collision:g} |" in text
    assert f"after {scenario.time.limit:g} s" in text


def test_each_scenario_is_shown_by_a_scripted_policy_and_a_trained_one() -> None:
    pytest.importorskip("pygame", reason="pygame comes with the extra `render`")
    pictures = part("site_pages.pictures")
    blind = {name for name in scenario_names() if not pictures.trained_for(name)}
    assert blind == {"terrain"}, "learned policies see no terrain"
    assert {pictures.scripted_for(name) for name in scenario_names()} == {"tangent_bug", "com1_rev3", "orca"}
    assert pictures.trained_for("static") == [("ppo_mixed", {})]
    (_, overrides), *_ = pictures.trained_for("rooms")
    assert load("rooms", overrides).robot == load("static").robot


def test_each_registered_id_stands_on_a_page(scenarios: Mapping[str, str]) -> None:
    everything = "\n".join(scenarios.values())
    for base in bug_gym.SCENARIOS_BY_ID:
        assert all(f"`{base.replace('-v0', f'{form}-v0')}`" in everything for form in bug_gym.FORMS)
    assert f"`{bug_gym.PREDICTION_ID}`" in everything and f"`{bug_gym.ROBOTS_ID}`" in everything


def test_the_page_of_the_environment_is_its_docstring(scenarios: Mapping[str, str]) -> None:
    text = scenarios["environments/navigation_env.md"]
    assert "## Action Space" in text and "## Version History" in text and "Raises:" not in text


def test_each_module_of_the_api_is_there() -> None:
    api = part("site_pages.api")
    for names in api.MODULES.values():
        assert all(importlib.import_module(name).__doc__ for name in names)
    assert set(api.FEW) <= {name for names in api.MODULES.values() for name in names}


# ------------------------------------------------------------------------------------------------ numbers


def test_how_a_policy_fares_is_what_the_json_says() -> None:
    told = part("site_pages.numbers").fares()
    found = json.loads((ROOT / "docs" / "results" / "learned.json").read_text(encoding="utf-8"))["models"]
    mine = {(fare.policy, fare.worlds): fare for fare in told if fare.result == "learned"}
    assert {(model, scenario) for model, some in found.items() for scenario in some} == set(mine)
    for (model, scenario), fare in mine.items():
        record = found[model][scenario]
        assert (fare.n, fare.success, fare.low, fare.high) == tuple(
            record[key] for key in ("n", "success", "low", "high")
        )
    assert all(fare.low <= fare.success <= fare.high and fare.n > 0 for fare in told)
    (barn,) = [fare for fare in told if fare.result == "barn" and fare[1:4] == ("BARN, robot holonomic", "bug1", "")]
    record = json.loads((ROOT / "docs" / "results" / "barn.json").read_text(encoding="utf-8"))["results"][
        "holonomic bug1"
    ]
    assert (barn.n, barn.success) == (record["worlds"], record["success"])


@pytest.mark.parametrize("path", BOARD, ids=[path.stem for path in BOARD])
def test_an_entry_of_the_leaderboard_has_command_commit_seeds_and_intervals(path: Path) -> None:
    entry = json.loads(path.read_text(encoding="utf-8"))
    assert entry["name"] == path.stem
    assert re.fullmatch(r"[0-9a-f]{40}", entry["commit"]) and entry["command"].startswith("bug-gym evaluate --scenario")
    for one in entry["summaries"]:
        assert one["n"] == entry["seeds"][one["scenario"]]["count"]
        assert 0.0 <= one["success_low"] <= one["success"] <= one["success_high"] <= 1.0
        assert one["policy"] in entry["policies"]


def test_the_leaderboard_is_ordered_by_success_and_says_where_each_line_comes_from() -> None:
    text = part("site_pages.leaderboard").pages()["leaderboard.md"]
    for scenario in part("site_pages.leaderboard").SCENARIOS:
        rows = re.findall(rf"^## {scenario}\n\n((?:\|.*\n)+)", text, re.MULTILINE)[0].splitlines()[2:]
        reached = [float(row.split(" | ")[2].split(" ")[0]) for row in rows]
        assert reached == sorted(reached, reverse=True) and len(reached) > 3
    for path in BOARD:
        entry = json.loads(path.read_text(encoding="utf-8"))
        assert entry["command"] in text and entry["commit"] in text


def test_a_line_of_the_leaderboard_tells_that_its_worlds_are_no_longer_these() -> None:
    board = part("site_pages.leaderboard").board
    entry = json.loads(BOARD[0].read_text(encoding="utf-8"))
    assert "earlier version" not in board("rush", [entry])
    older = entry | {"digests": entry["digests"] | {"rush": "0" * 16}}
    assert board("rush", [older]).count("(in worlds of an earlier version)") == 9
    assert "earlier version" not in board("maze", [older])


def test_an_entry_is_what_an_evaluation_wrote(tmp_path: Path) -> None:
    evaluate(["go_to_goal"], "empty", episodes=2, out=tmp_path)
    make = part("make_entry").entry
    entry = make(tmp_path, "mine", "0" * 40, about="Straight on.")
    (one,) = entry["summaries"]
    assert (one["policy"], one["scenario"], one["n"], one["success"]) == ("go_to_goal", "empty", 2, 1.0)
    assert entry["seeds"] == {"empty": {"first": 0, "count": 2}} and entry["privileged"] == []
    assert entry["command"] == "bug-gym evaluate --scenario empty --episodes 2 --policies go_to_goal --out mine"
    told = ["a_star", "d_star_lite:known=false", "velocity_obstacle:privileged=true"]
    evaluate(told, "empty", episodes=1, out=tmp_path / "told")
    marked = ["a_star (privileged)", "velocity_obstacle:privileged=true (privileged)"]
    entry = make(tmp_path / "told", "mine", "0" * 40)
    assert entry["privileged"] == marked and f"--policies {','.join(told)} --out" in entry["command"]
    with pytest.raises(ValueError, match="got 'no name' as the name of an entry"):
        make(tmp_path, "no name", "0" * 40)
    with pytest.raises(ValueError, match=r"expected what `bug-gym evaluate --out` writes"):
        make(tmp_path / "nowhere", "mine", "0" * 40)


def test_an_entry_is_of_the_worlds_that_its_command_drives(tmp_path: Path) -> None:
    make = part("make_entry").entry
    near = tmp_path / "near"
    evaluate(["go_to_goal"], "empty", episodes=1, out=near, overrides={"world.goal": [2.0, 0.0]})
    with pytest.raises(ValueError, match="empty was driven with other values, expected the scenario empty as it is"):
        make(near, "mine", "0" * 40)
    suite = {
        "version": 1,
        "seeds": {"count": 2},
        "scenarios": ["empty", {"scenario": "disc", "seeds": {"count": 1}}],
        "policies": ["go_to_goal"],
    }
    several = tmp_path / "several"
    evaluate(None, suite, out=several)
    with pytest.raises(ValueError, match=r"got other numbers of worlds by scenario \(2 of empty from 0, 1 of disc"):
        make(several, "mine", "0" * 40)


def test_an_entry_has_the_commit_of_the_code_that_made_its_rows(tmp_path: Path) -> None:
    module = part("make_entry")
    evaluate(["go_to_goal"], "empty", episodes=1, out=tmp_path)
    module.require_own_code(tmp_path)
    manifest = tmp_path / "manifest.json"
    told = json.loads(manifest.read_text(encoding="utf-8"))
    told["versions"]["bug_gym_source"] = 16 * "0"
    manifest.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(ValueError, match="other source of bug_gym has made its rows"):
        module.require_own_code(tmp_path)


# ------------------------------------------------------------------------------------------------ sources and links


def test_the_pages_by_hand_lead_to_where_things_lie_on_the_site(tmp_path: Path) -> None:
    staging = part("site_pages.staging")
    staging.stage(tmp_path)
    made = {"algorithms/index.md", "index.md"}
    for page in tmp_path.rglob("*.md"):
        for link in re.findall(r"\]\(([^)\s#]+)[^)\s]*\)", page.read_text(encoding="utf-8")):
            if "://" not in link:
                target = (page.parent / link).resolve()
                assert target.is_file() or target.relative_to(tmp_path).as_posix() in made, (page.name, link)
    notebooks = {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert {path.stem for path in (tmp_path / "tutorials").glob("*.ipynb")} == notebooks


def test_the_site_has_each_page_that_the_documentation_lists() -> None:
    staging = part("site_pages.staging")
    text = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    pages = {f"docs/{page}" for page in re.findall(r"\]\(([a-z_/]+\.md)\)", text)}
    assert len(pages) > 10 and pages <= {*staging.places(), *staging.INSTEAD}


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#there">x</a><a href="https://example.org/">y</a><p id="here">')
    (tmp_path / "b.html").write_text(
        '<p id="there"><a href="a.html#gone">x</a><img src="lost.png"><a href="#there">z</a>'
    )
    broken, elsewhere = part("site_pages.links").check(tmp_path)
    assert broken == ["b.html: a.html#gone", "b.html: lost.png"]
    assert elsewhere == ["https://example.org/"]


def test_the_buttons_of_the_front_page_are_of_the_repository_that_builds_it() -> None:
    said = part("site_pages.staging").badges("me/gym")
    assert said.count("github.com/me/gym/actions/workflows/test.yml") == 2
    assert "colab.research.google.com/github/me/gym/blob/main/notebooks/colab.ipynb" in said
    assert (ROOT / "notebooks" / "colab.ipynb").is_file() and (ROOT / ".github" / "workflows" / "test.yml").is_file()


def test_every_notebook_is_a_tutorial_of_the_site() -> None:
    pytest.importorskip("sphinx", reason="Sphinx comes with the extra `docs`")
    assert {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")} == set(part("make_site").TUTORIALS)


def test_docstrings_become_what_sphinx_reads() -> None:
    pytest.importorskip("sphinx", reason="Sphinx comes with the extra `docs`")
    lines = ["A* and `a*b`.", "", "## Heading", "| a | b |", "|---|---|", "| 1 | x_ |", "", "+--+", "|  |", "+--+"]
    written = list(part("site_pages.docstrings").in_rst(lines))
    assert "A\\* and `a*b`." in written and ".. rubric:: Heading" in written
    assert [line for line in written if re.match(r" +(\*|-) ", line)] == [
        "   * - a",
        "     - b",
        "   * - 1",
        "     - x\\_",
    ]
    assert written[written.index("::") : written.index("::") + 5] == ["::", "", "    +--+", "    |  |", "    +--+"]
