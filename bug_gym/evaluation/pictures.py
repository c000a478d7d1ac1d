"""Pictures and films of episodes, and the pictures of a result folder: a typical episode of each policy and scenario."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, load_pillow, save_png
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.failures import Failure
from bug_gym.evaluation.plan import Plan
from bug_gym.evaluation.progress import Track
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.files import file_name
from bug_gym.workers import each

logger = logging.getLogger("bug_gym")


def portrait(rollout: Rollout, canvas: Canvas) -> Frame:
    """Drive the rollout's first world to its end, and draw the whole path."""
    canvas.record()
    while not rollout.is_over:
        rollout.advance()
        canvas.record()
    return canvas.draw(rollout.drawings(), scan=False, note=rollout.verdict(), states=rollout.states())


def film(rollout: Rollout, canvas: Canvas, *, every: int = 1, scan: bool = True) -> Iterator[Frame]:
    """Drive the rollout's first world to its end; a frame of the start, of every so many steps, and of the end.

    Args:
        rollout: what to film.
        canvas: where to draw it.
        every: steps between two frames.
        scan: whether to draw the beams, too.

    Raises:
        ValueError: `every` below 1.
    """
    if every < 1:
        raise ValueError(f"every must be at least 1, got {every}")
    yield canvas.draw(rollout.drawings(), scan=scan, note=rollout.verdict(), states=rollout.states())
    while not rollout.is_over:
        for _ in range(every):
            rollout.advance()
            canvas.record()
            if rollout.is_over:
                break
        yield canvas.draw(rollout.drawings(), scan=scan, note=rollout.verdict(), states=rollout.states())


class _Picture(NamedTuple):
    """An episode to draw into a file."""

    policy: PolicyEntry
    scenario: ScenarioEntry
    seed: int
    path: Path


def draw_typical(plan: Plan, rows: Sequence[EpisodeRow], folder: Path, workers: int, track: Track[Any]) -> None:
    """A picture of a typical episode of each policy in each scenario; those that are there already are kept."""
    try:
        load_pygame()
        load_pillow()
    except ImportError as error:
        logger.warning("no pictures: %s", error)
        return
    folder.mkdir(exist_ok=True)
    wanted = []
    for scenario, policy in plan.pairs():
        mine = [row for row in rows if (row.scenario, row.policy) == (scenario.label, policy.label)]
        path = folder / f"{file_name(f'{scenario.label}-{policy.label}')}.png"
        if mine and not path.exists():  # who failed has no episode that counts
            wanted.append(_Picture(policy, scenario, typical(mine).seed, path))
    for failure in track(each(_draw_picture, wanted, workers), "pictures", len(wanted)):
        if failure is not None:
            logger.warning("no picture: %s", failure.told)


def typical(rows: Sequence[EpisodeRow]) -> EpisodeRow:
    """The success with the median path, or the first row where there is no success."""
    solved = sorted((row for row in rows if row.success), key=lambda row: row.path_length)
    return solved[(len(solved) - 1) // 2] if solved else rows[0]


def _draw_picture(picture: _Picture) -> Failure | None:
    """Draw an episode into its file; a policy that fails at it, as its `draw` may, has none."""
    rollout = Rollout(picture.policy, picture.scenario, [picture.seed])
    try:
        frame = portrait(rollout, Canvas(rollout.simulation, title=picture.policy.label))
    except Exception as error:  # of a caller's code: any
        return Failure.of(error, picture.policy, picture.scenario).as_text()
    save_png(picture.path, frame)
    return None
