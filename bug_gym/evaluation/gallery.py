"""All policies on one map, side by side: one picture of their ways and one film of them on their way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bug_gym.config import Scenario
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import grid, save_gif, save_png, together
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.pictures import film, portrait
from bug_gym.evaluation.rollout import Rollout
from bug_gym.geometry import F64
from bug_gym.worlds.layout import Layout

FRAMES = 36
"""Most frames of the film; a longer episode is shown faster."""
SURROUNDINGS = 0.06
"""What is shown around everything that there is, as a share of its longer side."""

Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax [m]."""


def draw_gallery(
    scenario: Scenario, policies: Sequence[PolicyEntry], *, seed: int, size: int, png: Path, gif: Path | None
) -> None:
    """Drive each policy through the world of a seed; write the picture, and the film where one is asked for.

    They show the part of the world in which something is.
    """
    entry = ScenarioEntry(scenario.name, scenario, range(seed, seed + 1))
    ways = [way_of(policy, entry, seed) for policy in policies]
    box = box_around(np.concatenate([way.places for way in ways]), scenario.world.box)

    def canvas_of(policy: PolicyEntry) -> tuple[Rollout, Canvas]:
        rollout = Rollout(policy, entry, [seed], slots=1)
        return rollout, Canvas(rollout.simulation, size=size, title=policy.label, box=box)

    save_png(png, grid([portrait(*canvas_of(policy)) for policy in policies]))
    if gif is None:
        return
    every = max(1, math.ceil(max(way.steps for way in ways) / FRAMES))
    films = [film(*canvas_of(policy), every=every, scan=False) for policy in policies]
    save_gif(gif, together(films), 1.0 / (scenario.time.step * min(every, 4)))


class Way(NamedTuple):
    """What the episode of a policy takes up."""

    steps: int
    """How many steps it has."""
    places: F64
    """Where something is in it (k, 2) [m]: obstacles, movers, goals and robots."""


def way_of(policy: PolicyEntry, entry: ScenarioEntry, seed: int) -> Way:
    """Drive a policy to the end of its episode."""
    rollout = Rollout(policy, entry, [seed], slots=1)
    world = rollout.simulation.world
    places, steps = [corners_of(world.layout(0))], 0
    while not rollout.is_over:
        rollout.advance()
        steps += 1
        places += [world.pose[0, :, :2].copy(), *([corners_of(world.layout(0))] if world.layout(0).movers else [])]
    return Way(steps, np.concatenate(places))


def corners_of(layout: Layout) -> F64:
    """Corners (k, 2) of the boxes around all that stands or moves in a world, and its starts and goals [m]."""
    corners = np.array([[-1.0, -1.0], [1.0, 1.0]])
    parts = [layout.starts[:, :2], layout.goals, *(rings[0] for rings in layout.polygons)]
    parts += [circle[:2] + circle[2] * corners for circle in layout.circles]
    for mover in layout.movers:
        outline = np.asarray(mover.outline)
        parts.append(np.array(mover.at) + (outline if outline.ndim else float(outline) * corners))
    return np.concatenate(parts)


def box_around(places: F64, whole: Box) -> Box:
    """The box around places (k, 2), with some room; a side near that of the whole world is moved there."""
    low, high = places.min(axis=0), places.max(axis=0)
    more = SURROUNDINGS * float((high - low).max())
    least = [edge if side - edge < 3.0 * more else side - more for side, edge in zip(low, whole[:2], strict=True)]
    most = [edge if edge - side < 3.0 * more else side + more for side, edge in zip(high, whole[2:], strict=True)]
    return float(least[0]), float(least[1]), float(most[0]), float(most[1])
