"""Files that are written whole or not at all, and where results come from."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import bug_gym


@contextmanager
def replaced_when_done(path: str | Path) -> Iterator[Path]:
    """A place to write a file to, which takes its name once it is whole; a failure leaves nothing behind."""
    target = Path(path)
    partial = target.with_name(f"{target.stem}.partial{target.suffix}")
    try:
        yield partial
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    versions = {"bug_gym": bug_gym.__version__, "python": platform.python_version()}
    versions |= {name: version(name) for name in ("gymnasium", "numpy", "numba")}
    return {"cpu": cpu_model(), "cores": os.cpu_count(), **versions}


def cpu_model() -> str:
    """Name of the processor, as well as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
