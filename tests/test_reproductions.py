"""The reproductions behind `bug-gym reproduce`: each runs, and its claims hold, on its first seeds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bug_gym.cli import main
from bug_gym.reproductions import REPRODUCTIONS, reproduction
from bug_gym.reproductions.result import Settings


def test_all_72_cells_of_oni_and_wangs_table_come_out_as_they_should() -> None:
    result = reproduction("oni-wang-table-1")(Settings(workers=2))
    cells = result.data["cells"]
    assert sum(len(routes) for routes in cells.values()) == 72
    for policy, routes in cells.items():
        for route, cell in routes.items():
            # Reached or not as printed, and within 1.5 % or three steps of 0.1 m of the ideal rounded length.
            assert (cell["length"] is None) == (cell["printed"] is None), (policy, route, cell)
            if cell["length"] is not None:
                allowed = max(0.015 * cell["rounded"], 0.3)
                assert abs(cell["length"] - cell["rounded"]) <= allowed, (policy, route, cell)
    assert result.holds


def test_the_json_says_what_made_it(tmp_path: Path) -> None:
    out = tmp_path / "table.json"
    assert main(["reproduce", "oni-wang-table-1", "--out", str(out)]) == 0
    record = json.loads(out.read_text(encoding="utf-8"))
    assert record["name"] == "oni-wang-table-1" and len(record["commit"]) in (7, 40)


def test_an_unknown_reproduction_is_refused_with_the_nearest_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "oni-wang"]) == 2
    assert "did you mean 'oni-wang-table-1'" in capsys.readouterr().err


@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_each_reproduction_can_be_found(name: str) -> None:
    assert callable(reproduction(name))
