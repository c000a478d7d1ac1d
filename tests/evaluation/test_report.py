"""Tables and files of a summary."""

import csv
import io
import json
import subprocess
import sys
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt
from rich.console import Console

from bug_gym.agents import policy_names
from bug_gym.agents.learning.folder import trained_names
from bug_gym.evaluation.report import FEWER_PAIRS, print_differences, print_table, write_summary
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import Summary, compare, summarise

BLANK = EpisodeRow(
    "a", "box", 0, 0, "success", "", True, 8.0, 80, 8.0, 0.2, 8.0, 1.0, nan, 0.5, 0, 0.0, 0.004, 0.01, 0.1
)
ROWS = [
    replace(BLANK, policy="bug2", seed=1, time=10.0, path_length=9.8, goal_distance=0.2, spl=0.8),
    replace(BLANK, policy="bug2", seed=2, time=20.0, path_length=13.8, goal_distance=0.2, spl=8.0 / 14.0),
    replace(BLANK, policy="[red]pipe|d[/red]", seed=1, outcome="collision", success=False, spl=0.0),
    replace(BLANK, policy="[red]pipe|d[/red]", seed=2, outcome="gave_up", success=False, spl=0.0, verdict="stuck"),
]
FILES = {"summary.json", "summary.csv", "differences.csv", "summary.md", "summary.tex"}


def printed(summaries: list[Summary], width: int = 240) -> str:
    """What print_table prints on a screen that is so many columns wide."""
    console = Console(file=io.StringIO(), width=width)
    print_table(summaries, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def refuse_constant(text: str) -> float:
    """Fail on what Python's JSON reads but strict JSON does not have."""
    raise AssertionError(f"{text} is not JSON")


def load(path: Path) -> Any:
    """Read a strict JSON file."""
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse_constant)


def test_a_printed_line_shows_the_numbers_of_its_policy() -> None:
    (line,) = [line for line in printed(summarise(ROWS)).splitlines() if "bug2" in line]
    # Two successes of two; (10 / 8 + 14 / 8) / 2 = 1.5; (10 + 20) / 2 = 15 s; 4 ms a decision.
    for text in ("100 [", "1.50", "15.0", "4.000", "0.69"):
        assert text in line


def test_names_intervals_and_numbers_are_whole_on_a_screen_of_80_columns() -> None:
    rows = [replace(row, policy="a_long_name_of_a_policy" if row.success else "short") for row in ROWS]
    text = printed(summarise(rows), width=80)
    assert "…" not in text
    # A long name goes on in the next line; together its pieces are the name.
    assert "a_long_name_of_a_policy" in "".join(word for line in text.splitlines() for word in line.split()[:1])


def test_a_narrow_screen_folds_names_and_no_numbers() -> None:
    rows = [replace(row, policy="a_long_name_of_a_policy" if row.success else "short") for row in ROWS]
    # Wilson's lower bound at 2 of 2 is 2 / (2 + 1.96^2) = 0.342.
    assert "100 [34, 100]" in printed(summarise(rows), width=60)


def test_percents_have_a_decimal_where_rounding_would_hide_an_episode() -> None:
    rows = [replace(ROWS[0], seed=seed) for seed in range(200)]
    # Wilson's lower bound at 200 of 200 is 200 / (200 + 1.96^2) = 0.9812.
    assert "100.0 [98.1, 100.0]" in printed(summarise(rows))


@pytest.mark.parametrize("name", [*policy_names(), *trained_names()])
def test_on_a_screen_of_80_columns_a_long_name_is_folded_and_no_number(name: str) -> None:
    rows = [replace(row, policy=name, time_ratio=0.5) for row in ROWS[:2]]
    lines = printed(summarise(rows), width=80).splitlines()
    first = next(number for number, line in enumerate(lines) if "100 [34, 100]" in line)
    room = lines[first].index("100 [34, 100]")
    told = "".join(line[:room].strip() for line in lines[first:])
    assert told == name
    assert lines[first].split()[-6:] == ["0.69", "1.50", "0.50", "15.0", "0", "4.000"]


def test_the_number_of_episodes_stands_in_the_title_or_where_it_differs_in_the_lines() -> None:
    assert "box, 2 episodes a policy" in printed(summarise(ROWS))
    (line,) = [line for line in printed(summarise(ROWS[:3])).splitlines() if "bug2" in line]
    assert line.split()[:2] == ["bug2", "2"]


def test_a_policy_named_in_brackets_is_printed_as_it_is_named() -> None:
    assert "[red]pipe|d[/red]" in printed(summarise(ROWS))


def test_there_is_a_table_for_each_scenario_and_one_for_all() -> None:
    rows = [*ROWS, *(replace(row, scenario="maze") for row in ROWS)]
    text = printed(summarise(rows))
    assert [text.count(title) for title in ("box", "maze", "all scenarios")] == [1, 1, 1]


def test_a_single_scenario_needs_no_table_for_all() -> None:
    assert "all scenarios" not in printed(summarise(ROWS))


def test_a_column_in_which_nothing_was_measured_is_left_out() -> None:
    assert "earliest" not in printed(summarise(ROWS)) and "SPL" in printed(summarise(ROWS))
    moving = summarise([replace(row, spl=nan, time_ratio=0.5) for row in ROWS])
    assert "earliest" in printed(moving) and "SPL" not in printed(moving)


def test_printing_no_summaries_is_refused() -> None:
    with pytest.raises(ValueError, match="no summaries"):
        printed([])


def test_the_rows_come_back_from_the_json(tmp_path: Path) -> None:
    rows = [replace(row, time_ratio=0.5) for row in ROWS]
    write_summary(tmp_path, rows, summarise(rows))
    assert [EpisodeRow.from_dict(data) for data in load(tmp_path / "summary.json")["rows"]] == rows


def test_the_json_is_strict_and_holds_the_summaries(tmp_path: Path) -> None:
    rows = [replace(row, spl=nan, shortest_path_length=inf) for row in ROWS]
    summaries = summarise(rows)
    write_summary(tmp_path, rows, summaries)
    assert load(tmp_path / "summary.json")["summaries"] == [summary.as_dict() for summary in summaries]


def test_the_csv_has_a_line_for_each_summary(tmp_path: Path) -> None:
    summaries = summarise(ROWS)
    write_summary(tmp_path, ROWS, summaries)
    lines = list(csv.DictReader(io.StringIO((tmp_path / "summary.csv").read_text(encoding="utf-8"))))
    assert [(line["policy"], line["scenario"]) for line in lines] == [(one.policy, one.scenario) for one in summaries]
    assert [float(line["success"]) for line in lines] == [one.success for one in summaries]
    assert lines[1]["verdicts"] == "stuck:1" and lines[1]["time"] == ""


def test_each_markdown_table_is_as_wide_as_its_header(tmp_path: Path) -> None:
    write_summary(tmp_path, ROWS, summarise(ROWS))
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    header, rule, *lines = [line.replace("\\|", "") for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 and "pipe" in lines[1]
    assert {line.count("|") for line in (header, rule, *lines)} == {header.count("|")}


@pytest.mark.parametrize(
    "name", ["<b>a</b>", "`a`", "a\\|b", "*a* **b**", "_a_ __init__ bug1_pair", "&lt;a", "~~a~~", "ends\\", "x=1|y=`2`"]
)
def test_a_name_stands_in_the_markdown_as_it_is(name: str, tmp_path: Path) -> None:
    rows = [replace(BLANK, policy=f"p {name}", scenario=f"w {name}", seed=seed) for seed in (1, 2)]
    write_summary(tmp_path, rows, summarise(rows))
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    read = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(text)
    cells = [one.children or [] for one in read if one.type == "inline"]
    shown = ["".join(part.content for part in cell if part.type == "text") for cell in cells]
    assert f"w {name}" in shown and f"p {name}" in shown


PAIRED = [
    *(replace(BLANK, policy="bug1", seed=seed, time=time) for seed, time in ((1, 12.0), (2, 20.0))),
    *(replace(BLANK, policy="bug2", seed=seed, time=time) for seed, time in ((1, 10.0), (2, 17.0))),
]


def test_differences_are_printed_with_their_interval_beside_the_baselines_name() -> None:
    console = Console(file=io.StringIO(), width=60)
    print_differences(compare(PAIRED, "bug2"), console)
    assert isinstance(console.file, io.StringIO)
    title, *_, line = [line for line in console.file.getvalue().splitlines() if line.strip()]
    assert "difference to bug2" in title
    # 2 s and 3 s more: their mean is 2.5, and the mean of two drawn of them lies between them.
    assert "bug1" in line and "+2.5 [+2.0, +3.0]" in line


def test_a_difference_of_fewer_pairs_than_success_says_of_how_many(tmp_path: Path) -> None:
    lost = [replace(BLANK, policy="bug1", seed=3, outcome="collision", success=False, spl=0.0)]
    rows = [*PAIRED, *lost, replace(BLANK, policy="bug2", seed=3)]
    console = Console(file=io.StringIO(), width=240)
    print_differences(compare(rows, "bug2"), console)
    assert isinstance(console.file, io.StringIO)
    printed = console.file.getvalue()
    # Success and SPL are of all three worlds, time of the two in which both arrived.
    (line,) = [line for line in printed.splitlines() if "bug1" in line]
    assert line.split()[:2] == ["bug1", "3"] and line.count("(") == 1
    assert line.rstrip().endswith("+2.5 [+2.0, +3.0] (2)")
    assert printed.rstrip().endswith(FEWER_PAIRS)
    write_summary(tmp_path, rows, summarise(rows), compare(rows, "bug2"))
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert FEWER_PAIRS in text and "| +2.5 [+2.0, +3.0] (2) |" in text
    with (tmp_path / "differences.csv").open(encoding="utf-8") as file:
        assert {line["field"]: line["n"] for line in csv.DictReader(file)}["time"] == "2"


def test_where_all_pairs_are_compared_no_count_is_told() -> None:
    console = Console(file=io.StringIO(), width=240)
    print_differences(compare(PAIRED, "bug2"), console)
    assert isinstance(console.file, io.StringIO) and "(" not in console.file.getvalue()


def test_without_differences_none_are_printed() -> None:
    console = Console(file=io.StringIO())
    print_differences(compare(PAIRED[:2], "bug1"), console)
    assert isinstance(console.file, io.StringIO) and console.file.getvalue() == ""


def test_differences_come_back_from_the_json_and_the_csv(tmp_path: Path) -> None:
    differences = compare(PAIRED, "bug2")
    write_summary(tmp_path, PAIRED, summarise(PAIRED), differences)
    assert load(tmp_path / "summary.json")["differences"] == [one.as_dict() for one in differences]
    lines = list(csv.DictReader(io.StringIO((tmp_path / "differences.csv").read_text(encoding="utf-8"))))
    assert [(line["policy"], line["field"]) for line in lines] == [(one.policy, one.field) for one in differences]
    assert [float(line["mean"]) for line in lines if line["field"] == "time"] == [2.5]
    assert "difference to bug2" in (tmp_path / "summary.md").read_text(encoding="utf-8")


def test_a_folder_is_made_and_holds_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "deeper"
    write_summary(folder, ROWS, summarise(ROWS))
    assert {path.name for path in folder.iterdir()} == FILES


def test_writing_again_replaces_the_files(tmp_path: Path) -> None:
    write_summary(tmp_path, ROWS, summarise(ROWS))
    write_summary(tmp_path, ROWS[:1], summarise(ROWS[:1]))
    assert len(load(tmp_path / "summary.json")["rows"]) == 1
    assert {path.name for path in tmp_path.iterdir()} == FILES


def test_a_file_is_complete_before_it_takes_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_summary(tmp_path, ROWS, summarise(ROWS))
    before = {name: (tmp_path / name).read_bytes() for name in FILES}

    def fail(source: Path, target: Path) -> None:
        assert load(source)["rows"], "the text must be written by now"
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_summary(tmp_path, ROWS[:1], summarise(ROWS[:1]))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_writing_no_summaries_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no summaries"):
        write_summary(tmp_path, ROWS, [])
    assert list(tmp_path.iterdir()) == []


def test_the_module_loads_without_rich_and_matplotlib() -> None:
    code = (
        "import sys, bug_gym.evaluation.report; print([name for name in ('rich', 'matplotlib') if name in sys.modules])"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
