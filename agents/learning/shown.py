"""How far a training is, for people: a bar on a terminal, a line every few seconds where there is none."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bug_gym.agents.learning.folder import Point
from bug_gym.agents.learning.settings import AnySettings

LINE_EACH = 10.0
"""Time between two lines [s]."""
DRAW_EACH = 0.1
"""Time between two looks of a bar [s]."""
VALIDATING, SAVING, TESTING, WRITING = "validating", "saving", "testing in held-out worlds", "writing the model"
"""What a training does beside learning."""


class Report:
    """Is told how far a training is, and tells nobody.

    Args:
        settings: of the training.
        clock: gives the time [s].
    """

    def __init__(self, settings: AnySettings, clock: Callable[[], float] = time.monotonic) -> None:
        self.name, self.total, self.clock = settings.name, settings.n_timesteps, clock
        self.done = 0.0
        """Steps that are done; those that were driven and not yet learnt from count half."""
        self.point: Point | None = None
        """The last validation."""
        self.doing = ""
        """What it does beside learning."""

    def __call__(self, done: float, point: Point | None) -> None:
        """The training is at so many steps, and learns."""
        self.done, self.point, self.doing = done, point, ""
        self._show(is_stage=False)

    def stage(self, doing: str) -> None:
        """The training does something beside learning."""
        self.doing = doing
        self._show(is_stage=True)

    def _show(self, *, is_stage: bool) -> None:
        """Show it to somebody."""


class BarReport(Report):
    """Tells it by a bar of rich.

    Args:
        settings: of the training.
        bar: rich's.
    """

    def __init__(self, settings: AnySettings, bar: Any) -> None:
        super().__init__(settings)
        self._bar, self._task = bar, bar.add_task(settings.name, total=settings.n_timesteps)
        self._drawn = -DRAW_EACH

    def _show(self, *, is_stage: bool) -> None:
        now = self.clock()
        if is_stage or self.done >= self.total or now >= self._drawn + DRAW_EACH:
            self._drawn = now
            told = "" if self.point is None else f" {100.0 * self.point.success:.1f} % success"
            doing = f", {self.doing}" if self.doing else ""
            self._bar.update(self._task, completed=round(self.done), description=f"{self.name}{told}{doing}")


class LineReport(Report):
    """Tells it by lines.

    Args:
        settings: of the training.
        write: takes a line.
        clock: gives the time [s].
    """

    def __init__(
        self, settings: AnySettings, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(settings, clock)
        self._write = write
        self._begin: tuple[float, float] | None = None
        self._written = self.clock()

    def _show(self, *, is_stage: bool) -> None:
        now = self.clock()
        if self._begin is None:
            self._begin = now, self.done
        elif now < self._written + LINE_EACH and self.doing != TESTING:
            return
        self._written = now
        self._write(f"{self.name}: {', '.join(self._parts(now))}")

    def _parts(self, now: float) -> Iterator[str]:
        assert self._begin is not None
        if self.done <= self.total:
            yield f"{self.done:,.0f} of {self.total:,} steps"
        else:  # the last rollout is driven to its end
            yield f"{self.done:,.0f} steps, {self.total:,} asked"
        begun, first = self._begin
        rate = (self.done - first) / (now - begun) if now > begun else 0.0
        if rate > 0.0:
            yield f"{rate:,.0f} a second"
        if rate > 0.0 and self.done < self.total:
            yield f"{told_time((self.total - self.done) / rate)} left"
        if self.point is not None:
            yield f"{100.0 * self.point.success:.1f} % success at {self.point.steps:,}"
        if self.doing:
            yield self.doing


def told_time(seconds: float) -> str:
    """A time in the two largest of its units: 3 h 20 min, 5 min 7 s, 12 s."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours:,} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


@contextmanager
def reported(settings: AnySettings, *, shown: bool) -> Iterator[Report]:
    """Who is told how far a training is: a bar on a terminal, else lines, all on standard error; or nobody."""
    if not shown or sys.stderr is None:
        yield Report(settings)
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield LineReport(settings, lambda line: print(line, file=sys.stderr, flush=True))
        return
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bar:
        yield BarReport(settings, bar)
