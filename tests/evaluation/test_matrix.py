"""The matrix of policies and scenarios, and the policy that others are compared with."""

import io
from dataclasses import replace
from math import nan

import pytest
from rich.console import Console

from bug_gym.evaluation.matrix import matrix, print_matrix
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PRIVILEGED, default_baseline, summarise

BLANK = EpisodeRow(
    "a", "box", 0, 0, "success", "", True, 8.0, 80, 8.0, 0.2, 8.0, 0.9, nan, 0.5, 0, 0.0, 0.004, 0.01, 0.1
)


def rows_of(policy: str, scenario: str, successes: int, n: int = 10, spl: float = 0.9) -> list[EpisodeRow]:
    """Rows of which so many are successes."""
    solved = replace(BLANK, policy=policy, scenario=scenario, spl=spl)
    failed = replace(solved, outcome="timeout", success=False, spl=0.0)
    return [replace(solved if seed < successes else failed, seed=seed) for seed in range(n)]


ROWS = [
    *rows_of("random", "box", 0),
    *rows_of("random", "maze", 1),
    *rows_of("[red]good[/red]", "box", 9),
    *rows_of("[red]good[/red]", "maze", 8),
    *rows_of("learned", "box", 10),
    *rows_of("oracle" + PRIVILEGED, "box", 10),
    *rows_of("oracle" + PRIVILEGED, "maze", 10),
]


def printed(rows: list[EpisodeRow], width: int = 80, height: int = 25) -> list[str]:
    """The lines that print_matrix prints."""
    console = Console(file=io.StringIO(), width=width, height=height)
    print_matrix(summarise(rows, resamples=1), console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_the_most_successful_policy_stands_first_and_who_did_not_drive_everywhere_last() -> None:
    whole = matrix(summarise(ROWS, resamples=1))
    assert whole.scenarios == ("box", "maze")
    assert [line.policy for line in whole.lines] == ["oracle (privileged)", "[red]good[/red]", "random", "learned"]
    assert [line.is_privileged for line in whole.lines] == [True, False, False, False]
    assert whole.lines[-1].overall is None and whole.lines[-1].cells[1] is None


def test_a_printed_line_has_the_share_over_all_with_its_interval_and_that_of_each_scenario() -> None:
    (line,) = [line for line in printed(ROWS) if "good" in line]
    # 17 of 20: Wilson's bounds are the roots of (0.85 - p)^2 = 1.96^2 p (1 - p) / 20, 0.640 and 0.948.
    assert line.split() == ["[red]good[/red]", "85", "[64,", "95]", "90", "80"]
    (line,) = [line for line in printed(ROWS) if "learned" in line]
    assert line.split() == ["learned", "–", "100", "–"]


def test_a_single_scenario_has_one_column() -> None:
    title, header, _, line = printed(rows_of("one", "box", 10))
    assert "10 episodes a cell" in title and header.split() == ["policy", "box"]
    assert line.split() == ["one", "100", "[72,", "100]"]  # 10 / (10 + 1.96^2) = 0.722


def test_no_name_and_no_number_is_cut_off_on_a_narrow_screen() -> None:
    name, scenarios = "a_very_long_name_of_a_policy" + PRIVILEGED, [f"scenario_{number}" for number in range(8)]
    lines = printed([row for scenario in scenarios for row in rows_of(name, scenario, 10)], width=40)
    assert lines[-1].startswith(name) and lines[-1].split().count("100") == 9
    assert "…" not in "".join(lines)


@pytest.mark.parametrize(("policies", "width", "height"), [(40, 120, 30), (60, 240, 24), (10, 80, 24)])
def test_the_matrix_fits_the_screen_where_it_can(policies: int, width: int, height: int) -> None:
    names = [f"policy_{number:02}" for number in range(policies)]
    lines = printed([row for name in names for row in rows_of(name, "box", 5)], width, height)
    assert len(lines) < height and max(map(len, lines)) <= width
    assert sorted(word for line in lines for word in line.split() if word.startswith("policy_")) == names


def test_nothing_is_no_matrix() -> None:
    with pytest.raises(ValueError, match="no summaries"):
        matrix([])


def test_the_default_baseline_is_the_most_successful_policy_that_does_not_read_the_map() -> None:
    assert default_baseline(ROWS) == "[red]good[/red]"
    assert default_baseline([row for row in ROWS if row.policy != "[red]good[/red]"]) == "random"
    assert default_baseline([row for row in ROWS if row.policy.endswith(PRIVILEGED)]) == "oracle (privileged)"


def test_between_equally_successful_policies_the_shorter_way_decides_and_then_the_order() -> None:
    long, short = rows_of("long", "box", 9, spl=0.5), rows_of("short", "box", 9, spl=0.8)
    assert default_baseline([*long, *short]) == "short"
    moving = [replace(row, spl=nan, shortest_path_length=nan) for row in (*long, *short)]
    assert default_baseline(moving) == "long"


def test_without_rows_there_is_no_baseline() -> None:
    with pytest.raises(ValueError, match="no rows"):
        default_baseline([])
