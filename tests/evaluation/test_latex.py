"""Tables for LaTeX."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bug_gym.evaluation.latex import SIGNS, latex_table, latex_text
from bug_gym.evaluation.report import write_summary
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import compare, summarise
from bug_gym.evaluation.text_table import TextTable

NAMES = ["bug1_pair", "100 % & more", r"a\b{c}", "#1 $x^2~", "[red]", "*star", '<b>|"q"']
ROW = EpisodeRow("a", "box", 0, 0, "success", "", True, 8.0, 80, 8.0, 0.2, 8.0, 1.0, 1.0, 0.5, 0, 0.0, 0.004, 0.01, 0.1)

LOST: dict[str, Any] = {"outcome": "timeout", "success": False, "spl": 0.0}


def read(text: str) -> str:
    """What LaTeX sets of a text that holds no command but those of SIGNS; groups of nothing part ligatures."""
    assert not re.search("--|''|``|,,|[?!]`", text), "LaTeX sets these as one character"
    signs = sorted(((written, sign) for sign, written in SIGNS.items()), key=lambda pair: -len(pair[0]))
    signs += [("{}", ""), ("$-$", "-")]
    shown = ""
    while text:
        written, sign = next((pair for pair in signs if text.startswith(pair[0])), (text[0], text[0]))
        shown, text = shown + sign, text[len(written) :]
    return shown


def cells(row: str) -> list[str]:
    """The cells of a row of a `tabular`, as they are set."""
    assert row.endswith(r" \\")
    assert not row.startswith(("[", "*")), "the row before would take it for its options"
    return [read(cell) for cell in row.removesuffix(r" \\").removeprefix("{}").split(" & ")]


def body(tex: str) -> list[list[str]]:
    """Header and lines of the one table."""
    _, _, rest = tex.partition("\\toprule\n")
    rows, _, _ = rest.partition("\n\\bottomrule")
    return [cells(row) for row in rows.splitlines() if row != "\\midrule"]


@given(st.text(alphabet=st.characters(codec="ascii", categories=("L", "N", "P", "S", "Zs"))))
def test_a_text_is_set_as_it_is(text: str) -> None:
    assert read(latex_text(text)) == text


@pytest.mark.parametrize("text", ["--", "a---b", "''", "``", ",,", "?`", "!`", "-- ''"])
def test_two_characters_are_not_set_as_one(text: str) -> None:
    assert read(latex_text(text)) == text


@given(st.text(alphabet=sorted(SIGNS)))
def test_no_sign_of_a_text_is_left_to_latex(text: str) -> None:
    left = latex_text(text)
    for written in sorted(SIGNS.values(), key=len, reverse=True):
        left = left.replace(written, "")  # the longest first, as some hold others
    assert left == ""


def test_numbers_below_nothing_have_a_minus_and_names_a_hyphen() -> None:
    assert (
        latex_text("-0.5 [-1.2, +0.2] of BugGym/Static-v0 and A-1")
        == "$-$0.5 [$-$1.2, +0.2] of BugGym/Static-v0 and A-1"
    )


def test_a_table_has_the_cells_that_it_is_given() -> None:
    header, lines = ["policy", "success [%]"], [[name, "94 [88, 97]"] for name in NAMES]
    tex = latex_table(TextTable("success of bug1_pair", header, lines))
    assert body(tex) == [header, *lines]
    assert r"\begin{tabular}{lr}" in tex and r"\caption{success of bug1\_pair}" in tex


@pytest.mark.parametrize("scenarios", [["box"], ["box", "hall_2"]])
def test_the_file_begins_with_the_matrix_and_has_all_tables(scenarios: list[str], tmp_path: Path) -> None:
    rows = [
        replace(ROW, policy=policy, scenario=scenario, seed=seed, **(LOST if seed == 0 else {}))
        for policy in ("bug1_pair", "com")
        for scenario in scenarios
        for seed in range(4)
    ]
    summaries = summarise(rows)
    write_summary(tmp_path, rows, summaries, compare(rows, "com"))
    first, *others = (tmp_path / "summary.tex").read_text(encoding="utf-8").split("\\begin{table}")[1:]
    header, *lines = body(first)
    assert header == (["policy", *scenarios] if len(scenarios) == 1 else ["policy", "all scenarios", *scenarios])
    assert [line[0] for line in lines] == ["bug1_pair", "com"] and lines[0][1].startswith("75 [")
    assert all(cell == "75" for line in lines for cell in line[2:])
    everywhere = ["all scenarios"] if len(scenarios) > 1 else []
    titles = [read(other.split("\\caption{")[1].split("}\n")[0]) for other in others]
    assert titles == [*scenarios, *everywhere, "difference to com in the same worlds"]
