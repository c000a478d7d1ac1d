"""A*, D* Lite and RRT* beside other libraries' in one process: `python docs/compare_planners.py` writes planner_speed.md.

Compared with what is installed of pyastar2d (C++), rustworkx (Rust, costs by calls of Python) and ompl (C++, whether a
piece is clear by calls of Python), which nothing here needs otherwise: they are the extra `compare`. Without them the
tables have our rows alone. Times are of the processor. Grids have 30 % random obstacles; all answer the same questions in
turn, and lengths are compared. The picture needs the extra `report`.
"""

from __future__ import annotations

import argparse
import importlib
import math
import subprocess
import time
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.d_star_lite import DStarLite
from bug_gym.agents.planning.dijkstra import distances
from bug_gym.agents.planning.grid import COLUMN_STEPS, FAR, ROW_STEPS, Grid, make_grid, relink_nodes
from bug_gym.agents.planning.rrt_star import rrt_star
from bug_gym.agents.planning.search import Found
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.agents.planning.triangulated import Task
from bug_gym.evaluation.curves import draw_curves
from bug_gym.files import machine, replaced_when_done
from bug_gym.reproductions.d2t_tables import MARGIN, map_of
from bug_gym.reproductions.d2t_worlds import field, scenario_1, scenario_2
from bug_gym.reproductions.result import Curves

SHARE = 0.3
"""Of the cells that are blocked."""
CHANGED = 10
"""Cells that change between two repairs."""
PAGE = Path(__file__).with_name("planner_speed.md")


class Question(NamedTuple):
    """A grid, and two cells of it that a way joins."""

    grid: Grid
    start: int
    goal: int


class Measured(NamedTuple):
    """What one planner took and found."""

    milliseconds: list[float]
    """Of each question."""
    lengths: list[float]
    """Of each way [cells], of which steps count 1 and the root of 2."""


Answer = Callable[[Question], float]
"""The length of the way."""


def question(side: int, seed: int, connectivity: int) -> Question:
    """Random cells, and two ends in opposite corners as far apart as a way joins them."""
    generator = np.random.default_rng([side, seed])
    grid = make_grid((generator.random((side, side)) < SHARE).astype(np.uint8), connectivity=connectivity)
    for start in np.flatnonzero(grid.blocked.ravel() == 0).tolist():
        reached = np.flatnonzero(distances(grid, start) < FAR)
        if len(reached) > 0.3 * grid.blocked.size:  # not a pocket between obstacles
            return Question(grid, start, int(reached[-1]))
    raise ValueError(f"no way across {side} x {side} cells of seed {seed}")


# ----------------------------------------------------------------------------------------------------------- libraries


def by_pyastar2d(asked: Question) -> Answer:
    """Its A*; with eight neighbours it counts steps and passes between diagonal obstacles, so only four are compared."""
    library: Any = importlib.import_module("pyastar2d")
    weights = np.where(asked.grid.blocked, np.float32(np.inf), np.float32(1.0)).astype(np.float32)
    ends = [tuple(map(int, divmod(node, asked.grid.lattice.columns))) for node in (asked.start, asked.goal)]
    return lambda asked: len(library.astar_path(weights, *ends, allow_diagonal=False)) - 1.0


def by_rustworkx(asked: Question) -> Answer:
    """Its A* over a graph of the open steps."""
    library: Any = importlib.import_module("rustworkx")
    graph, columns = library.PyDiGraph(), asked.grid.lattice.columns
    graph.add_nodes_from(range(asked.grid.blocked.size))
    for step, (down, across) in enumerate(zip(ROW_STEPS, COLUMN_STEPS, strict=True)):
        nodes = np.flatnonzero(asked.grid.links >> step & 1)
        long = math.hypot(down, across)
        graph.add_edges_from([(node, node + down * columns + across, long) for node in nodes.tolist()])
    row, column = divmod(asked.goal, columns)

    def left(node: int) -> float:
        dy, dx = abs(node // columns - row), abs(node % columns - column)
        return dx + dy if asked.grid.connectivity == 4 else max(dx, dy) + (math.sqrt(2.0) - 1.0) * min(dx, dy)

    def answer(asked: Question) -> float:
        nodes = library.digraph_astar_shortest_path(graph, asked.start, asked.goal.__eq__, float, left)
        return math.fsum(
            math.dist(divmod(a, columns), divmod(b, columns)) for a, b in zip(nodes[:-1], nodes[1:], strict=True)
        )

    return answer


LIBRARIES: dict[str, tuple[Callable[[Question], Answer], tuple[int, ...]]] = {
    "pyastar2d": (by_pyastar2d, (4,)),
    "rustworkx": (by_rustworkx, (4, 8)),
}
"""What makes its answer to a question, and the neighbours with which it answers the same one."""


# ---------------------------------------------------------------------------------------------------------- measuring


def ours(asked: Question) -> float:
    """A* of this package."""
    return a_star(asked.grid, asked.start, asked.goal).length


def a_star_rows(side: int, seeds: int, connectivity: int) -> dict[str, Measured]:
    """All planners on the same questions, one after the other on each."""
    found: dict[str, Measured] = {}
    for seed in range(seeds):
        asked = question(side, seed, connectivity)
        answers: dict[str, Answer] = {"bug_gym a_star": ours}
        for name, (make, neighbours) in LIBRARIES.items():
            if find_spec(name) is not None and connectivity in neighbours:
                answers[f"{name} {version(name)}"] = make(asked)
        for name, answer in answers.items():
            answer(asked)  # what compiles or loads does so here
            began = time.process_time()
            length = answer(asked)
            row = found.setdefault(name, Measured([], []))
            row.milliseconds.append(1e3 * (time.process_time() - began))
            row.lengths.append(length)
    return found


def d_star_lite_rows(side: int, repairs: int) -> dict[str, Measured]:
    """Repairs after each few changed cells, beside A* begun anew; changes are anywhere on the grid."""
    asked = question(side, 0, 8)
    generator = np.random.default_rng(1)
    search = DStarLite(asked.grid, asked.goal)
    search.find(asked.start)
    rows = {"bug_gym d_star_lite, repaired": Measured([], []), "bug_gym a_star, anew": Measured([], [])}
    for _ in range(repairs + 1):
        cells = generator.integers(1, side + 1, (CHANGED, 2))
        nodes = (cells[:, 0] * asked.grid.lattice.columns + cells[:, 1]).astype(np.int32)
        nodes = np.unique(nodes[(nodes != asked.start) & (nodes != asked.goal)])
        asked.grid.blocked.ravel()[nodes] ^= 1
        relink_nodes(asked.grid, nodes)

        def repaired(nodes: Any = nodes) -> Found:
            search.change(nodes)
            return search.find(asked.start)

        def anew() -> Found:
            return a_star(asked.grid, asked.start, asked.goal)

        for row, answer in zip(rows.values(), (repaired, anew), strict=True):
            began = time.process_time()
            found = answer()
            row.milliseconds.append(1e3 * (time.process_time() - began))
            row.lengths.append(found.length)
    for row in rows.values():  # the first of each compiles
        del row.milliseconds[0], row.lengths[0]
    return rows


# --------------------------------------------------------------------------------------------------------------- RRT*


SAMPLES = (500, 2000, 5000, 10_000, 20_000)
"""After which lengths are looked at."""
PIECES = (1.0, 5.0)
"""The longest piece of a tree [m]: one for maps that are narrow, and what the policy has unless told."""
MAPS: tuple[Callable[[], Task], ...] = (scenario_1, scenario_2, lambda: field(3, 60))
"""Of polygons, about 45 x 30 m."""
TREES = ("RRTstar", "InformedRRTstar")
"""Of ompl."""
OURS, ALIKE = "bug_gym rrt_star", ", as many samples"
"""Our row, and the end of the name of one with as many samples."""


class Curve(NamedTuple):
    """How a planner's ways fall toward the shortest one."""

    over: list[list[float]]
    """At each point of the curve, of each run: length over the shortest [%], infinite where there is no way yet."""


def tree_of_ompl(
    name: str, solids: Solids, task: Task, piece: float, seconds: list[float], seed: int
) -> tuple[list[float], list[float]]:
    """Lengths of one of its planner's ways [m]: after so many samples, and after so many seconds of the processor.

    Its pieces are at most as long as ours, keep as far from the same obstacles, and are tried by the same function.
    """
    base, geometric, util = (importlib.import_module(f"ompl.{part}") for part in ("base", "geometric", "util"))
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(seed + 1)

    def check_motion(_: Any, one: Any, other: Any) -> bool:
        """Whether a piece is clear."""
        return solids.is_clear((one[0], one[1]), (other[0], other[1]))

    exact: Any = type("Exact", (base.MotionValidator,), {"checkMotion": check_motion})
    space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
    for axis, (low, high) in enumerate(zip(task.border.min(axis=0), task.border.max(axis=0), strict=True)):
        bounds.setLow(axis, float(low))
        bounds.setHigh(axis, float(high))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    validator = exact(information)
    information.setMotionValidator(validator)
    information.setStateValidityChecker(lambda state: True)  # what lies in an obstacle is reached by no clear piece
    information.setup()
    ends = [information.allocState() for _ in range(2)]
    for state, place in zip(ends, (task.start, task.goal), strict=True):
        state[0], state[1] = place
    problem = base.ProblemDefinition(information)
    problem.setStartAndGoalStates(*ends, 1e-3)
    problem.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    planner = getattr(geometric, name)(information)
    planner.setRange(piece)
    planner.setProblemDefinition(problem)
    planner.setup()
    after_samples: list[float] = []
    after_seconds: list[float] = []
    began, asked = time.process_time(), 0

    def is_enough() -> bool:
        nonlocal asked  # once a sample
        spent, best = time.process_time() - began, planner.bestCost().value()
        while len(after_samples) < len(SAMPLES) and asked >= SAMPLES[len(after_samples)]:
            after_samples.append(best)
        while len(after_seconds) < len(seconds) and spent >= seconds[len(after_seconds)]:
            after_seconds.append(best)
        asked += 1
        return len(after_samples) == len(SAMPLES) and len(after_seconds) == len(seconds)

    planner.solve(base.PlannerTerminationCondition(is_enough))
    return after_samples, after_seconds


def rrt_star_rows(runs: int, piece: float) -> tuple[list[float], dict[str, Curve]]:
    """Median times of ours after some numbers of samples [s], and how far each planner is over the shortest way."""
    times: list[list[float]] = [[] for _ in SAMPLES]
    rows: dict[str, Curve] = {}

    def add(name: str, shortest: float, lengths: list[float]) -> None:
        row = rows.setdefault(name, Curve([[] for _ in SAMPLES]))
        for at, long in zip(row.over, lengths, strict=True):
            at.append(100.0 * (long / shortest - 1.0))

    trees = TREES if find_spec("ompl") is not None else ()
    for make in MAPS:
        task = make()
        plan, growth = map_of(task), task.radius + MARGIN
        shortest, solids = plan.shortest_path(task.start, task.goal, radius=growth).length, Solids.of(plan, growth)
        rrt_star(solids, plan.box, task.start, task.goal, samples=10)  # compiles
        for seed in range(runs):
            spent: list[float] = []
            for samples, of_all in zip(SAMPLES, times, strict=True):
                began = time.process_time()
                found = rrt_star(solids, plan.box, task.start, task.goal, samples=samples, seed=seed, step=piece)
                spent.append(time.process_time() - began)
                of_all.append(spent[-1])
            add(OURS, shortest, [float(found.lengths[samples - 1]) for samples in SAMPLES])
            for tree in trees:
                after_samples, after_seconds = tree_of_ompl(tree, solids, task, piece, sorted(spent), seed)
                name = f"ompl {version('ompl')} {tree}"
                add(f"{name}{ALIKE}", shortest, after_samples)
                add(f"{name}, as much time", shortest, after_seconds)
    return [median(one) for one in times], rows


def curves(piece: float, times: list[float], rows: dict[str, Curve]) -> str:
    """A table of the page: medians, and how many runs had no way yet."""
    heads = [f"{samples:,} samples, {1e3 * spent:.3g} ms" for samples, spent in zip(SAMPLES, times, strict=True)]
    lines = [
        f"**RRT\\*, pieces of {piece:g} m: length over the shortest way [%], median of "
        f"{len(rows[OURS].over[0])} runs on {len(MAPS)} maps of polygons**",
        "",
        "| planner | " + " | ".join(heads) + " |",
        "|---" * (1 + len(heads)) + "|",
    ]
    for name, row in rows.items():
        cells = [f"{median(at):.2f}" + (f" ({none} none)" if (none := at.count(math.inf)) else "") for at in row.over]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def drawn(piece: float, rows: dict[str, Curve]) -> Curves:
    """The table as a picture: of each planner's runs the median, the least and the most."""
    lines = {
        name.removesuffix(ALIKE): [
            (_finite(median(at)), _finite(min(at)), _finite(max(at))) for at in row.over
        ]
        for name, row in rows.items()
        if name.startswith("bug_gym") or name.endswith(ALIKE)
    }  # fmt: skip
    label = "length over the shortest way [%]"
    return Curves(f"RRT*, pieces of {piece:g} m", "samples", label, SAMPLES, lines, y_range=(0.0, 30.0))


def _finite(value: float) -> float:
    """The value; no number where there is no way yet, so that nothing is drawn."""
    return value if math.isfinite(value) else math.nan


READING = (
    "Times are medians of ours. All keep the same distance from the same obstacles. What ompl asks of Python takes most of "
    "its time: the rows of as many samples compare the trees, those of as much time what a user of Python gets. (k none): "
    "runs without a way yet, counted as infinite."
)


def require_equal(rows: dict[str, Measured]) -> None:
    """Raises a ValueError where two planners' ways differ in length."""
    (first, own), *others = rows.items()
    for name, row in others:
        for mine, theirs in zip(own.lengths, row.lengths, strict=True):
            if mine != theirs and not math.isclose(mine, theirs, rel_tol=1e-6):
                raise ValueError(f"{first} finds {mine:.6f} cells, {name} {theirs:.6f}: expected equal lengths")


def table(title: str, rows: dict[str, Measured]) -> str:
    """A table of the page."""
    (_, own), *_ = rows.items()
    base = median(own.milliseconds)
    lines = [
        f"**{title}**",
        "",
        "| planner | questions | median [ms] | least - most [ms] | to the first |",
        "|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        low, middle, high = min(row.milliseconds), median(row.milliseconds), max(row.milliseconds)
        lines.append(f"| {name} | {len(row.lengths)} | {middle:.3g} | {low:.3g} - {high:.3g} | {middle / base:.3g} |")
    return "\n".join(lines)


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=1000, help="cells along a side (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=7, help="grids (default: %(default)s)")
    parser.add_argument("--repairs", type=int, default=100, help="repairs of D* Lite (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=5, help="of RRT* on each map (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=PAGE, help="the page to write (default: planner_speed.md)")
    options = parser.parse_args()
    chosen = {
        name: value for name, value in vars(options).items() if name != "out" and value != parser.get_default(name)
    }
    asked = "".join(f" --{name} {value}" for name, value in chosen.items())
    parts = []
    for connectivity in (8, 4):
        rows = a_star_rows(options.side, options.seeds, connectivity)
        require_equal(rows)
        parts.append(table(f"A*, {options.side:,} x {options.side:,} cells, {connectivity} neighbours", rows))
    rows = d_star_lite_rows(options.side, options.repairs)
    require_equal(rows)
    parts.append(table(f"{CHANGED} changed cells on {options.side:,} x {options.side:,}", rows))
    trees = {piece: rrt_star_rows(options.runs, piece) for piece in PIECES}
    parts += [curves(piece, *found) for piece, found in trees.items()]
    picture = options.out.with_suffix(".png")
    draw_curves(picture, [drawn(piece, rows) for piece, (_, rows) in trees.items()])
    parts.append(f"![Length over the shortest way against the number of samples]({picture.name})")
    parts.append(READING)
    own = machine()
    commit = subprocess.check_output(["git", "rev-parse", "HEAD"], text=True, cwd=PAGE.parent).strip()
    page = [
        "# Speed of the planners",
        "",
        f"Written by `python docs/compare_planners.py{asked}`. "
        + " ".join((__doc__ or "").split("\n\n", 1)[1].split()),
        "",
        f"Machine: {own['cpu']}, {own['cores']} cores; Python {own['python']}, numpy {own['numpy']}, numba {own['numba']}. "
        f"Made at commit `{commit}`.",
        "",
        "\n\n".join(parts),
    ]
    with replaced_when_done(options.out) as file:
        file.write_text("\n".join(page) + "\n", encoding="utf-8")
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
