"""Worlds of the DynaBARN benchmark."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

from bug_gym.limits import MOST_OBSTACLES
from bug_gym.schema.values import Box, Count, ExistingPath, NotNegative
from bug_gym.worlds.dynabarn_files import load_dynabarn
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import finish

LATEST = 1_000.0
"""Latest start that is drawn [s]: the periods are of half a minute or so and differ, so any phases may meet."""


class DynaBarnWorld(Family):
    """A world of the DynaBARN benchmark (Nair et al. 2022): three walls, and discs that follow splines over and over.

    The discs are where the benchmark's splines have them within 0.5 mm, go through walls and see nothing. At the end of an
    open spline a disc jumps to its beginning: it is gone, and there, and touches nothing on the way.
    """

    family: Literal["dynabarn"]
    bounds: Box = (-12.0, -12.0, 13.0, 12.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall. The benchmark has none, it is open on one side."""
    path: ExistingPath
    """A .jsonl with one world a line; relative to the scenario's file."""
    world: Count | None = None
    """Number of the world; none: drawn."""
    since: NotNegative | None = None
    """Time on the clock of the movers at which the episode starts [s], the same for all; none: drawn."""

    def data_files(self) -> tuple[Path, ...]:
        """The .jsonl."""
        return load_dynabarn.files(self.path)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A world of the DynaBARN benchmark."""
        worlds = load_dynabarn(self.path)
        if self.world is not None and self.world not in worlds:
            raise ValueError(f"no world {self.world} in {self.path}; it holds {sorted(worlds)}")
        chosen = worlds[sorted(worlds)[int(rng.integers(len(worlds)))] if self.world is None else self.world]
        since = float(rng.uniform(0.0, LATEST)) if self.since is None else self.since
        bodies = sum(math.ceil(crew.time_limit / track.period) + 1 for _, track in chosen.movers)
        if bodies > MOST_OBSTACLES:
            came = f"a time limit of {crew.time_limit:g} s makes {bodies:,} laps of the movers"
            raise ValueError(f"{came}, expected at most {MOST_OBSTACLES:,}")
        movers = tuple(
            Mover(radius, motion.place(0.0), motion)
            for radius, track in chosen.movers
            for motion in track.replays(since, crew.time_limit)
        )
        walls = tuple((wall,) for wall in chosen.walls)
        return finish(crew, self, chosen.start, chosen.goal, polygons=walls, movers=movers)
