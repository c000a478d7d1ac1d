"""What the targets of the Makefile give to the programs that they start."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(
    os.name == "nt" or shutil.which("make") is None, reason="needs make, and the shell that its targets are for"
)
def test_programs_keep_the_bytecode_of_packages_which_are_installed_without() -> None:
    asks = 'told: ; @echo "[$$PYTHONDONTWRITEBYTECODE]"'
    command = ["make", "--no-print-directory", "--eval", asks, "told"]
    told = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}, capture_output=True, text=True, check=True
    )
    assert told.stdout == "[]\n"
