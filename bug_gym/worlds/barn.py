"""Worlds of the BARN benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from bug_gym.schema.values import Box, Count, ExistingPath
from bug_gym.worlds.barn_files import load_barn
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish


class BarnWorld(Family):
    """A world of the BARN benchmark (Perille et al. 2020): cylinders, a start and a goal from a file."""

    family: Literal["barn"]
    bounds: Box = (-6.0, -1.0, 2.0, 15.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    path: ExistingPath
    """A .jsonl with one world a line, or a folder of `world_N.world` files; relative to the scenario's file."""
    world: Count | None = None
    """Number of the world; none: drawn."""

    def data_files(self) -> tuple[Path, ...]:
        """The .jsonl, or the files of a folder."""
        return load_barn.files(self.path)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A world of the BARN benchmark."""
        worlds = load_barn(self.path)
        if self.world is None:
            chosen = worlds[sorted(worlds)[int(rng.integers(len(worlds)))]]
        elif self.world in worlds:
            chosen = worlds[self.world]
        else:
            raise ValueError(f"no world {self.world} in {self.path}; it holds {sorted(worlds)}")
        return finish(crew, self, chosen.start, chosen.goal, circles=chosen.circles)
