"""The notebooks run from top to bottom."""

from __future__ import annotations

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_the_notebook_runs(path: Path, tmp_path: Path) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    notebook = nbformat.read(path, as_version=4)
    for package in ("minari", "stable_baselines3", "torch"):  # of extras that not every machine has
        if any(f"import {package}" in cell.source or f"from {package}" in cell.source for cell in notebook.cells):
            pytest.importorskip(package)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown)


@pytest.mark.parametrize("name", ["quickstart", "own_reward"])
def test_a_cell_that_drives_a_policy_says_the_same_when_it_is_run_again(name: str, tmp_path: Path) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    notebook = nbformat.read(next(path for path in NOTEBOOKS if path.stem == name), as_version=4)
    made, driven = [cell for cell in notebook.cells if cell.cell_type == "code"][:2]
    again = nbformat.from_dict({**driven, "id": "again"})
    notebook.cells = [made, driven, again]
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    first, second = ([output.get("text", output.get("data")) for output in cell.outputs] for cell in (driven, again))
    assert first and first == second
