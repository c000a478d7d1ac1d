"""Fixtures that several test files use."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import pytest

# A busy machine is no fault, nothing is left beside the tests, and each run tries the same until a number in the source is
# another: hypothesis tries those, too. `pytest -m hypothesis --hypothesis-profile hunt` tries others each time, and
# FUZZ_EXAMPLES does in test_fuzz.py.
hypothesis.settings.register_profile("hunt", deadline=None, database=None, print_blob=True, max_examples=1000)
hypothesis.settings.register_profile("plain", deadline=None, database=None, print_blob=False, derandomize=True)
hypothesis.settings.load_profile("plain")

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
"""Real data that may lie beside the project."""
NO_DATA = "no ../shared/data beside the project"


def is_promised() -> bool:
    """Whether the data has to be there: in continuous integration (CI=true) with BUG_GYM_DATA=promised."""
    return os.environ.get("CI") == "true" and os.environ.get("BUG_GYM_DATA") == "promised"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data that may lie beside the project.

    Where it does not the test skips, and pytest's summary counts it; it fails where CI=true and BUG_GYM_DATA=promised.
    """
    if not DATA.is_dir():
        if is_promised():
            pytest.fail(f"{NO_DATA}, and BUG_GYM_DATA=promised says that there is")
        pytest.skip(NO_DATA)
    return DATA


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many tests the missing data has cost."""
    skipped = terminalreporter.getreports("skipped")
    count = sum(NO_DATA in str(report.longrepr) for report in skipped)
    if count:
        tests = "1 test that needs" if count == 1 else f"{count} tests that need"
        terminalreporter.write_line(f"{tests} real data did not run: {NO_DATA}", yellow=True)
