"""Processes that tests start and then stop by a signal."""

from __future__ import annotations

import signal


def as_from_a_terminal() -> None:
    """No signal is ignored, for `preexec_fn`: whoever runs the tests may ignore some, as nohup does, and hands that on."""
    for name in ("SIGINT", "SIGHUP", "SIGTERM"):
        signal.signal(getattr(signal, name), signal.SIG_DFL)
