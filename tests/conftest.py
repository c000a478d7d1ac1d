"""Fixtures that several test files use."""

from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile("plain", deadline=None, database=None, print_blob=False)
hypothesis.settings.load_profile("plain")  # a busy machine is no fault, and nothing is left beside the tests


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data that may lie beside the project; the test skips where it does not."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no ../shared/data beside the project")
    return folder
