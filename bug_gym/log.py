"""Lines of the log."""

from __future__ import annotations

import logging

logger = logging.getLogger("bug_gym")


told: set[str] = set()
"""What has been told once."""


def warn_once(message: str, about: str | None = None) -> None:
    """Say something in the log, the first time in this process that it, or anything else about the same, is said."""
    if (about or message) not in told:
        told.add(about or message)
        logger.warning("%s", message)
