"""The pages say what the code and the results say, and what they point at is there."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import runpy
from argparse import _SubParsersAction
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

import bug_gym
from bug_gym.agents.learning.settings import training_names
from bug_gym.cli import main, make_parser
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.summary import summarise
from bug_gym.files import released
from bug_gym.reproductions import REPRODUCTIONS

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in page.parts),
]
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]
RESULTS = ROOT / "docs" / "results"
FORMS = [path for path in sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")) if path.stem != "config"]
ARCHITECTURE = ROOT / "docs" / "architecture.md"


@pytest.fixture(autouse=True)
def beside_the_scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A script finds what lies beside it, as when it is run."""
    monkeypatch.syspath_prepend(ROOT / "docs")


def script(name: str) -> dict[str, Any]:
    """What a script of docs/ defines."""
    return runpy.run_path(str(ROOT / "docs" / name))


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------------ SQL


def test_the_sql_of_the_guide_reads_rows_with_and_without_a_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    duckdb = pytest.importorskip("duckdb", reason="duckdb is no dependency")
    (sql,) = re.findall(r"```sql\n(.*?)```", text_of(ROOT / "docs" / "guide" / "cluster.md"), re.S)
    empty = {"world": {"family": "empty"}, "time": {"limit": 10.0}}  # nothing to hit: its clearance is infinite
    found = evaluate("bug2", [empty, "ring", "static"], episodes=1, out=tmp_path / "results" / "many")
    monkeypatch.chdir(tmp_path)
    lines = duckdb.connect().execute(sql).fetchall()
    expected = {(one.policy, one.scenario): (one.success, one.path_ratio) for one in summarise(found)}
    assert len(lines) == 3
    for policy, scenario, success, ratio in lines:
        told = (success, math.nan if ratio is None else ratio)
        assert told == pytest.approx(expected[policy, scenario], nan_ok=True)


# ------------------------------------------------------------------------------------------------ made by scripts


def test_the_pages_of_results_are_what_the_json_says() -> None:
    """Where not: `python docs/make_results.py`."""
    pages = script("make_results.py")["pages"]()
    assert {path.name for path in RESULTS.glob("*.md")} == set(pages)
    for name, text in pages.items():
        assert text_of(RESULTS / name) == text, name


def test_no_two_tables_of_a_page_have_the_same_title() -> None:
    for page in RESULTS.glob("*.md"):
        titles = re.findall(r"^\*\*.*\*\*$", text_of(page), re.M)
        assert len(titles) == len(set(titles)), page.name


def test_each_reproduction_and_long_check_has_its_result_and_each_result_its_page() -> None:
    made = script("make_results.py")
    names = {*REPRODUCTIONS, *made["CHECKS"]}
    assert {path.stem for path in RESULTS.glob("*.json")} == names
    assert set(made["PAGES"]) == names


def test_a_result_that_contradicts_its_own_numbers_makes_no_page() -> None:
    found = json.loads(text_of(RESULTS / "learned.json"))
    with pytest.raises(ValueError, match="learned: the JSON says False of its claims, its numbers say True"):
        script("make_results.py")["page"]("learned", {**found, "holds": False})


def test_a_part_is_worth_something_where_its_tests_say_so_for_all_that_were_made() -> None:
    """Not where one of many intervals leaves 0 out, as that of four worlds gained and none lost does (p = 0.125)."""
    found = json.loads(text_of(RESULTS / "hd-bug-ablation.json"))
    nothing = {
        "success_minus_whole": [0.0, 0.0, 0.0], "p_value": 1.0, "path_minus_whole": None, "path_p_value": None,
        "changed": 0,
    }  # fmt: skip
    changes = {
        "risk": {"success_minus_whole": [0.04, 0.01, 0.08], "p_value": 0.125, "changed": 4},
        "goal": {"p_value": 1e-9},
    }
    results = {key: one | nothing for key, one in found["results"].items()}
    for part, change in changes.items():
        results[f"dynamic, {part}"] = results[f"dynamic, {part}"] | change
    parts = {key.split(", ")[1].replace("_", " ") for key in results} - {"whole", "hd bug map"}
    text = script("make_results.py")["page"]("hd-bug-ablation", {**found, "results": results})
    (idle,) = re.findall(r"no difference in any kind of world is left for: (.*?)\.", text)
    assert set(re.split(", | and ", idle)) == parts - {"goal"}
    (still,) = re.findall(r"These change no run: (.*?)\.", text)
    assert set(re.split(", | and ", still)) == parts - {"risk"}
    assert "What is left for" not in text


def test_a_part_without_which_ways_are_shorter_is_not_said_to_be_worth_anything() -> None:
    """Unless it is worth something elsewhere, in success or in ways."""
    found = json.loads(text_of(RESULTS / "hd-bug-ablation.json"))
    nothing = {"success_minus_whole": [0.0, 0.0, 0.0], "p_value": 1.0, "path_minus_whole": None, "path_p_value": None}
    shorter, longer = (
        {"path_minus_whole": [more, more - 0.5, more + 0.5], "path_p_value": 1e-9} for more in (-1.0, 1.0)
    )
    changes = {
        "dynamic, risk": shorter,
        "rush, goal": shorter,
        "u_trap, goal": longer,
        "rush, travel": {"success_minus_whole": [0.2, 0.1, 0.3], "p_value": 1e-9},
        "maze, shadow": shorter,
        "rooms, shadow": {"success_minus_whole": [-0.2, -0.3, -0.1], "p_value": 1e-9},
        "hook, phase_1": longer,
    }
    results = {key: one | nothing | changes.get(key, {}) for key, one in found["results"].items()}
    text = script("make_results.py")["page"]("hd-bug-ablation", {**found, "results": results})
    (named,) = re.findall(r"What is left for (.*?) is shorter ways without them", text)
    assert set(re.split(", | and ", named)) == {"risk", "travel"}


@pytest.mark.parametrize(
    ("new", "told"),
    [
        ({"decision_time_mean": 9.0}, []),
        ({"success": 0.9}, ["/rows/0/success: 1.0 -> 0.9"]),
        ({"worlds": 5}, ["/rows/0/worlds: only in the new one"]),
    ],
)
def test_results_are_confirmed_where_times_alone_are_others(
    tmp_path: Path, new: dict[str, float], told: list[str]
) -> None:
    row = {"success": 1.0, "decision_time_mean": 1.0}
    old, again = ({"commit": commit, "rows": [values]} for commit, values in (("a", row), ("b", {**row, **new})))
    committed, made = tmp_path / "committed.json", tmp_path / "made.json"
    committed.write_text(json.dumps(old))
    made.write_text(json.dumps(again))
    assert script("confirm_results.py")["confirm"](made, committed) == told
    assert json.loads(committed.read_text()) == {**old, **({} if told else {"confirmed": "b"})}


@pytest.mark.parametrize("option", [[], ["--keep-times"], ["--policy=bug2"]])
def test_a_result_that_has_no_page_is_refused_with_the_names_that_have_one(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    committed, new = tmp_path / "committed", tmp_path / "new"
    for folder, names in ((committed, ("barn", "bug-bounds")), (new, ("barn", "barm"))):
        folder.mkdir()
        for name in names:
            (folder / f"{name}.json").write_text(
                json.dumps({"commit": folder.name, "holds": None, "rows": [{"policy": "bug2"}]})
            )
    before = (committed / "barn.json").read_bytes()
    main = script("confirm_results.py")["main"]
    main.__globals__["RESULTS"] = committed
    assert main([*option, str(new / "barn.json"), str(new / "barm.json")]) == 2
    told = f"{new / 'barm.json'}: got the name barm.json, expected one of barn.json, bug-bounds.json\n"
    assert capsys.readouterr() == ("", told)
    assert main([*option, str(new / "bug-bounds.json")]) == 2
    assert capsys.readouterr() == ("", f"no file {new / 'bug-bounds.json'}\n")
    assert main(["--policy=bug2,apf", str(new / "barn.json")]) == 2
    assert capsys.readouterr() == ("", f"{new / 'barn.json'}: it says nothing of apf\n")
    assert (committed / "barn.json").read_bytes() == before
    assert main([*option, str(new / "barn.json")]) == 0
    assert (committed / "barn.json").read_bytes() != before


def test_new_results_may_keep_the_times_of_the_old_ones(tmp_path: Path) -> None:
    def result(commit: str, success: float, ms: float, **further: Any) -> dict[str, Any]:
        return {"commit": commit, "rows": {"bug": {"success": success, "decision_time": ms}, **further}, "ms": [ms]}

    committed, made = tmp_path / "committed.json", tmp_path / "made.json"
    committed.write_text(json.dumps(result("a", 0.5, 1.0)))
    replace = script("confirm_results.py")["replace_all_but_times"]
    for commit in "bc":
        made.write_text(json.dumps(result(commit, 0.6, 9.0, other={"ms": 9.0})))
        replace(made, committed)
        assert json.loads(committed.read_text()) == {**result(commit, 0.6, 1.0, other={"ms": 9.0}), "times_of": "a"}


def test_the_rows_of_one_policy_may_be_made_again_alone(tmp_path: Path) -> None:
    def result(commit: str, of_bug: float, of_apf: float, wrong: list[Any]) -> dict[str, Any]:
        rows = {"bug jackal": {"success": of_bug, "ms": 1.0}, "apf jackal": {"success": of_apf, "ms": commit}}
        return {"commit": commit, "holds": True, "rows": rows, "sweeps": [{"apf": of_apf}], "wrong": wrong}

    committed, made = tmp_path / "committed.json", tmp_path / "made.json"
    committed.write_text(json.dumps(result("a", 0.5, 0.6, [["bug", 1], ["apf", 2]])))
    made.write_text(json.dumps(result("b", 0.1, 0.9, [["other", 4], {"policy": "apf", "seed": 3}])))
    script("confirm_results.py")["replace_policies"](["apf"], made, committed)
    expected = result("a", 0.5, 0.9, [["bug", 1], {"policy": "apf", "seed": 3}])
    assert json.loads(committed.read_text()) == {
        **expected,
        "made_again": {"apf": "b"},
        "times_of": "a",
    }
    committed.write_text(json.dumps(result("a", 0.5, 0.6, [["bug", 1], ["apf", 2]])))
    script("confirm_results.py")["replace_policies"](["apf"], made, committed, new_times=True)
    expected["rows"]["apf jackal"]["ms"] = "b"
    known = {**expected, "made_again": {"apf": "b"}, "new_times": ["apf"]}
    assert json.loads(committed.read_text()) == known
    made.write_text(json.dumps(result("c", 0.4, 0.9, [])))
    script("confirm_results.py")["replace_all_but_times"](made, committed)
    kept = json.loads(committed.read_text())
    assert (kept["times_of"], kept["new_times"], kept["rows"]["apf jackal"]["ms"]) == ("a", ["apf"], "b")


def test_rows_of_a_policy_that_are_as_many_as_before_keep_their_places() -> None:
    rows_of = script("confirm_results.py")["with_rows_of"]
    assert rows_of("apf", [["apf", 1], ["bug", 2], ["apf", 3]], [["apf", 4], ["apf", 5]]) == [
        ["apf", 4], ["bug", 2], ["apf", 5],
    ]  # fmt: skip


def test_a_page_says_where_its_numbers_were_found_again() -> None:
    made = script("make_results.py")
    found = json.loads(text_of(RESULTS / "learned.json"))
    assert "The same were found at commit `abc`, but for times." in made["page"](
        "learned", {**found, "confirmed": "abc"}
    )
    of_abc = {**found, "times_of": "abc"}
    assert "are those of commit `abc`." in made["page"]("learned", of_abc)
    newer = made["page"]("learned", {**of_abc, "new_times": ["bug", "apf"]})
    assert "are those of commit `abc`, but for those of `bug` and `apf`." in newer


def test_the_page_of_policies_is_what_the_table_of_agents_says() -> None:
    """Where not: `python docs/make_policies.py`."""
    made = script("make_policies.py")
    assert text_of(ROOT / "docs" / "policies.md") == made["page"]()
    assert text_of(README) == made["readme"](text_of(README))


@pytest.mark.parametrize(
    "policy",
    [
        *("critical_point_bug", "modified_critical_point_bug", "operative_critical_point_bug"),
        *("apf", "apf_wall_following", "minimum_risk"),
    ],
)
def test_policies_of_papers_that_had_to_be_repaired_say_what_was_reported_and_found(policy: str) -> None:
    table = script("make_policies.py")["reports"]()
    (row,) = [line for line in table.splitlines() if line.startswith(f"| `{policy}`")]
    _, reported, found = row.strip("| ").split(" | ")
    assert len(reported) > 20 and len(found) > 100


def test_the_readme_stays_a_door() -> None:
    assert len(text_of(README).splitlines()) <= 130


# ------------------------------------------------------------------------------------------------ what is pointed at


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_a_page_has_one_title(page: Path) -> None:
    text = re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL)  # a drawing that is no code would make more
    assert len(re.findall(r"^#(?!#)", text, re.MULTILINE)) == 1


@pytest.mark.parametrize(
    "page",
    [*PAGES, *(ROOT / name for name in ("CHANGELOG.md", "SECURITY.md", "ros/README.md"))],
    ids=lambda page: page.name,
)
def test_no_level_of_headings_is_left_out(page: Path) -> None:
    """The site's builder warns of one, and its warnings are errors."""
    text = re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL)
    levels = [len(marks) for marks in re.findall(r"^(#+) ", text, re.MULTILINE)]
    assert all(level <= before + 1 for before, level in pairwise(levels))


def test_paths_in_the_page_of_the_architecture_exist() -> None:
    paths = re.findall(r"`((?:bug_gym|agents|configs|tests|docs)/[\w./-]*)`", text_of(ARCHITECTURE))
    assert len(paths) > 50
    assert not [path for path in paths if not (ROOT / path).exists()]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_and_modules_that_are_named_exist(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = text_of(page)
    for command in sorted(set(re.findall(r"\bbug-gym ([a-z]+(?:-[a-z]+)*)\b", "\n".join(code_in(text))))):
        with pytest.raises(SystemExit) as left:
            main([command, "--help"])
        assert left.value.code == 0, command
    assert set(re.findall(r"bug-gym reproduce ([a-z][\w-]*)", text)) <= set(REPRODUCTIONS)
    assert set(re.findall(r"bug-gym train ([a-z]\w*)", text)) <= set(training_names())
    assert all(map(importlib.util.find_spec, re.findall(r"python -m (bug_gym[\w.]*\w)", text)))
    assert all((ROOT / path).is_file() for path in re.findall(r"python (docs/\w+\.py)", text))


@pytest.mark.parametrize("page", [*PAGES, ROOT / "SECURITY.md", ROOT / "ros" / "README.md"], ids=lambda page: page.name)
def test_options_that_are_named_with_a_command_are_options_of_it(page: Path) -> None:
    (commands,) = (action.choices for action in make_parser()._actions if isinstance(action, _SubParsersAction))
    for code in code_in(text_of(page)):
        lines = code.replace("\\\n", " ") if code.endswith("\n") else code.replace("\n", " ")
        for name, said in re.findall(r"\bbug-gym ([a-z-]+)\b([^#\n]*)", lines):
            unknown = {*re.findall(r"(?<![\w-])--[a-z][a-z-]*", said)} - {*commands[name]._option_string_actions}
            assert not unknown, f"bug-gym {name}{said}"


def code_in(text: str) -> list[str]:
    """Code in a page: in blocks and between single marks."""
    blocks = re.findall(r"```\w*\n(.*?)```", text, re.DOTALL)
    return blocks + re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


# ------------------------------------------------------------------------------------------------ for those who take part


def test_the_citation_bears_the_version_and_the_license_of_the_package() -> None:
    said = yaml.safe_load(text_of(ROOT / "CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= said.keys()
    assert said["version"] == released(bug_gym.__version__) and said["license"] == "MIT"


@pytest.mark.parametrize("path", FORMS, ids=[path.stem for path in FORMS])
def test_a_form_for_issues_asks_what_helps(path: Path) -> None:
    said = yaml.safe_load(text_of(path))
    assert {"name", "description", "body"} <= said.keys()
    for field in said["body"]:
        assert field["type"] in ("textarea", "input") and field["attributes"]["label"].endswith(
            ("?", "Versions", "Source")
        )
        assert field["validations"]["required"] is True
    assert len({field["id"] for field in said["body"]}) == len(said["body"])
