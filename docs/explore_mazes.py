"""How far exploring alone brings a robot in mazes: cell by cell, with nothing lost to steering, turning or noise.

A robot in the mazes of `BugGym/Maze-v0` knows each cell that it sees straight along a passage, and which of its sides are open.
It goes where the way to its goal seems the least, unseen walls taken for open, each unseen step for 1, 2 or 3 steps; or it
knows that there is one way between any two cells, draws mazes at random of all that agree with what it has seen (Wilson 1996),
and goes where the goal lies behind most often for the way there. Prints a table.

    python docs/explore_mazes.py --mazes 200
"""

import argparse
import math
import random
from collections.abc import Callable
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np

from bug_gym.config import load
from bug_gym.worlds.grid import carve
from bug_gym.worlds.maze import MazeWorld

Cell = tuple[int, int]
Known = dict[frozenset[Cell], bool]
"""Of the borders between two cells that have been seen, whether they are open."""
Choice = Callable[[Cell, Cell, Known, random.Random], Cell]
"""The next cell, from where the robot is, its goal and what it knows."""

SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
DRAWN = 15
"""Mazes that are drawn for a decision."""


class Maze:
    """One maze of the scenario's size, with a start and a goal as far apart as the scenario wants."""

    def __init__(self, world: MazeWorld, reach: float, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.columns, self.rows = world.cells
        self.pitch = world.passages[0] + world.wall
        """From cell to cell [m]."""
        self.sees = int(reach / self.pitch)
        """How many cells away it sees."""
        right, up = carve(self.columns, self.rows, 0.0, rng)
        self.borders: Known = {}
        for x, y in np.ndindex(self.columns, self.rows):
            for dx, dy in SIDES[::2]:
                if x + dx < self.columns and y + dy < self.rows:
                    self.borders[frozenset([(x, y), (x + dx, y + dy)])] = bool((right if dx else up)[x, y])
        while True:
            (a, b), (c, d) = rng.integers(0, [self.columns, self.rows], (2, 2)).tolist()
            self.start, self.goal = (a, b), (c, d)
            if math.dist(self.start, self.goal) * self.pitch >= world.separation:
                return

    def beside(self, cell: Cell) -> list[Cell]:
        """The cells beside one."""
        near = ((cell[0] + dx, cell[1] + dy) for dx, dy in SIDES)
        return [(x, y) for x, y in near if 0 <= x < self.columns and 0 <= y < self.rows]

    def look(self, here: Cell, known: Known) -> None:
        """What is seen from a cell: it and those straight along its passages, and which of their sides are open."""
        for dx, dy in SIDES:
            cell = here
            for _ in range(self.sees + 1):
                for other in self.beside(cell):
                    border = frozenset([cell, other])
                    known[border] = self.borders[border]
                following = cell[0] + dx, cell[1] + dy
                if not known.get(frozenset([cell, following]), False):
                    break
                cell = following

    def ways(self, start: Cell, known: Known, unseen: float) -> tuple[dict[Cell, float], dict[Cell, Cell]]:
        """Least ways from a cell [steps], and the cell before each on its way, where an unseen border costs so much."""
        length, before, heap = {start: 0.0}, dict[Cell, Cell](), [(0.0, start)]
        while heap:
            way, cell = heappop(heap)
            for other in self.beside(cell) if way <= length[cell] else ():
                is_open = known.get(frozenset([cell, other]))
                further = way + (unseen if is_open is None else 1.0 if is_open else math.inf)
                if further < length.get(other, math.inf):
                    length[other], before[other] = further, cell
                    heappush(heap, (further, other))
        return length, before

    def drive(self, choose: Choice, seed: int) -> int:
        """Steps until the goal."""
        rng, known, cell, steps = random.Random(seed), Known(), self.start, 0
        self.look(cell, known)
        while cell != self.goal:
            cell = choose(cell, self.goal, known, rng)
            self.look(cell, known)
            steps += 1
        return steps

    def hopeful(self, unseen: float) -> Choice:
        """Along the least way, unseen borders taken for open."""

        def choose(cell: Cell, goal: Cell, known: Known, rng: random.Random) -> Cell:
            return first_step(self.ways(cell, known, unseen)[1], cell, goal)

        return choose

    def drawing(self) -> Choice:
        """To the edge of what is known behind which the goal lies most often, for the way there."""
        drawn_for, edge = 0, self.start

        def choose(cell: Cell, goal: Cell, known: Known, rng: random.Random) -> Cell:
            nonlocal drawn_for, edge
            length, before = self.ways(cell, known, math.inf)
            if goal in length:
                return first_step(before, cell, goal)
            if drawn_for != len(known) or edge == cell:
                found: dict[Cell, int] = {}
                for _ in range(DRAWN):
                    way = self.way_in(self.drawn(known, rng), cell, goal)
                    last = next(one for one, other in pairwise(way) if other not in length)
                    found[last] = found.get(last, 0) + 1
                drawn_for, edge = len(known), max(found, key=lambda one: found[one] / (length[one] + 1.0))
            return first_step(before, cell, edge)

        return choose

    def drawn(self, known: Known, rng: random.Random) -> Known:
        """A maze with one way between any two cells that agrees with what is known, all such equally likely: Wilson's."""
        group = {cell: cell for cell in np.ndindex(self.columns, self.rows)}

        def of(cell: Cell) -> Cell:
            while group[cell] != cell:
                cell = group[cell]
            return cell

        made = dict(known)
        for border, is_open in known.items():
            if is_open:
                one, other = border
                group[of(one)] = of(other)
        leads: dict[Cell, list[tuple[Cell, Cell]]] = {}
        for border in self.borders:
            one, other = border
            if border not in known and of(one) != of(other):
                leads.setdefault(of(one), []).append((one, other))
                leads.setdefault(of(other), []).append((other, one))
        belongs = {of(self.start)}
        for cell in leads:
            walk, here = dict[Cell, tuple[Cell, Cell]](), cell
            while here not in belongs:
                walk[here] = rng.choice(leads[here])
                here = of(walk[here][1])
            here = cell
            while here not in belongs:
                belongs.add(here)
                made[frozenset(walk[here])] = True
                here = of(walk[here][1])
        return made

    def way_in(self, made: Known, start: Cell, goal: Cell) -> list[Cell]:
        """The way from a cell to another one in a maze that is known."""
        _, before = self.ways(start, made, math.inf)
        way = [goal]
        while way[-1] != start:
            way.append(before[way[-1]])
        return way[::-1]


def first_step(before: dict[Cell, Cell], start: Cell, end: Cell) -> Cell:
    """The first cell on the way from one to another."""
    while before[end] != start:
        end = before[end]
    return end


def main() -> None:
    """Drive, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mazes", type=int, default=200)
    scenario = load("maze")
    assert isinstance(scenario.world, MazeWorld)
    mazes = [Maze(scenario.world, scenario.lidar.range, seed) for seed in range(parser.parse_args().mazes)]
    limit = scenario.time.limit * float(scenario.robot.max_speed)
    shortest = np.array([maze.ways(maze.start, maze.borders, math.inf)[0][maze.goal] for maze in mazes])
    explorers: dict[str, Callable[[Maze], Choice]] = {
        "unseen walls are open": lambda maze: maze.hopeful(1.0),
        "the same, an unseen step counts for 2": lambda maze: maze.hopeful(2.0),
        "the same, for 3": lambda maze: maze.hopeful(3.0),
        f"{DRAWN} mazes drawn": lambda maze: maze.drawing(),
    }
    print("| explorer | way / shortest | within the limit at top speed [%] | nine of ten need [m] |\n|---|---|---|---|")
    for name, make in explorers.items():
        ways = np.array([maze.drive(make(maze), seed) for seed, maze in enumerate(mazes)])
        metres = ways * mazes[0].pitch
        share, most = 100.0 * np.mean(metres <= limit), np.quantile(metres, 0.9)
        print(f"| {name} | {ways.sum() / shortest.sum():.2f} | {share:.1f} | {most:.0f} |", flush=True)


if __name__ == "__main__":
    main()
