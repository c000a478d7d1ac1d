"""Lines of the log."""

from __future__ import annotations

import functools
import logging

logger = logging.getLogger("bug_gym")


@functools.cache
def warn_once(message: str) -> None:
    """Say something in the log, the first time that it is said in this process."""
    logger.warning("%s", message)
