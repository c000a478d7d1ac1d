"""What tests that need real data say where it is missing: a count in pytest's summary, a failure where it is promised."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

def test_one(shared_data):
    assert (shared_data / "here").exists()

@pytest.mark.parametrize("number", [1, 2])
def test_two(number, shared_data):
    assert (shared_data / "here").exists()

def test_without(): pass

@pytest.mark.skip(reason="of something else")
def test_other(): pass
"""


def run(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Those tests under our conftest.py, in a project of their own."""
    project = folder / "project" / "tests"
    project.mkdir(parents=True)
    shutil.copy(Path(__file__).with_name("conftest.py"), project)
    (project / "test_data.py").write_text(TESTS, encoding="utf-8")
    (project.parent / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    kept = {name: value for name, value in os.environ.items() if name not in ("CI", "BUG_GYM_DATA", "PYTEST_ADDOPTS")}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments, str(project)]
    return subprocess.run(
        command, cwd=project.parent, env=kept | variables, capture_output=True, text=True, encoding="utf-8", check=False
    )


@pytest.mark.parametrize("arguments", [("-n", "0"), ("-n", "2")])
def test_the_summary_counts_the_tests_that_missed_their_data(arguments: tuple[str, ...], tmp_path: Path) -> None:
    done = run(tmp_path, *arguments)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("3 tests that need real data did not run: no ../shared/data beside the project") == 1
    assert "1 passed, 4 skipped" in done.stdout


def test_one_test_is_not_spoken_of_as_several(tmp_path: Path) -> None:
    assert "1 test that needs real data did not run" in run(tmp_path, "-k", "test_one").stdout


def test_nothing_is_said_where_the_data_is_there(tmp_path: Path) -> None:
    (tmp_path / "shared" / "data").mkdir(parents=True)
    (tmp_path / "shared" / "data" / "here").touch()
    done = run(tmp_path, CI="true", BUG_GYM_DATA="promised")
    assert done.returncode == 0 and "real data" not in done.stdout
    assert "4 passed, 1 skipped" in done.stdout


@pytest.mark.parametrize(
    "variables", [{"CI": "true"}, {"BUG_GYM_DATA": "promised"}, {"CI": "true", "BUG_GYM_DATA": ""}]
)
def test_data_that_nobody_promised_may_be_missing_in_ci_too(variables: dict[str, str], tmp_path: Path) -> None:
    done = run(tmp_path, **variables)
    assert done.returncode == 0 and "1 passed, 4 skipped" in done.stdout


def test_promised_data_that_is_missing_fails_the_tests_in_ci(tmp_path: Path) -> None:
    done = run(tmp_path, CI="true", BUG_GYM_DATA="promised")
    assert done.returncode == 1
    assert "1 passed, 1 skipped, 3 errors" in done.stdout
    assert "BUG_GYM_DATA=promised says that there is" in done.stdout
    assert "did not run" not in done.stdout
