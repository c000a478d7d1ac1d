"""What a step costs in ever larger worlds: `python docs/growing_worlds.py` writes growing_worlds.json and its picture.

`--draw` makes the picture out of the numbers that are there. The worlds are those of `bug-gym benchmark`: circles that all
move, 0.25 a square metre, 180 beams, one thread. Times are of the processor, of a step's core: motion, contacts, scan,
reward, without infos and new worlds. All sizes are measured in turn, round after round, and the least counts, as what
else a machine does can only add to it. It needs the extra `report`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from bug_gym.benchmark import BATCHES, DENSITY, GROWING, WORLDS, growing_world, random_actions
from bug_gym.evaluation.curves import draw_curves
from bug_gym.files import machine, replaced_when_done
from bug_gym.reproductions.result import Curves
from bug_gym.simulation import Simulation

DOCS = Path(__file__).parent
NUMBERS, PICTURE = DOCS / "growing_worlds.json", DOCS / "growing_worlds.png"
ROUNDS = 40
STEPS = 10
"""Of all worlds in a round."""
BODIES = WORLDS * 100
"""Obstacles of all worlds together at most: the more a world has, the fewer worlds, so that all take alike memory."""


def begun(obstacles: int) -> Simulation:
    """Worlds of so many obstacles, a few steps on."""
    worlds = min(WORLDS, BODIES // obstacles)
    simulation = Simulation(growing_world(obstacles), worlds)
    simulation.reset(seeds=range(worlds))
    step_time(simulation, 0)
    return simulation


def step_time(simulation: Simulation, number: int) -> float:
    """Time of a step of one world [us] in round `number`; new worlds do not count."""
    actions = random_actions(simulation.count).astype(np.float64)[:, :, None]
    spent = 0.0
    for step in range(number * STEPS, (number + 1) * STEPS):
        begin = process_time()
        simulation.advance(actions[step % BATCHES])
        spent += process_time() - begin
        _, _, terminated, truncated = simulation.transition(simulation.all_rows)
        ended = np.flatnonzero(terminated | truncated)
        if len(ended):
            simulation.reset(ended)
    return 1e6 * spent / (STEPS * simulation.count)


def measured(rounds: int) -> dict[str, Any]:
    """Times of a step [us] by the number of obstacles, and how they were measured."""
    worlds = {obstacles: begun(obstacles) for obstacles in GROWING}
    times: dict[int, list[float]] = {obstacles: [] for obstacles in GROWING}
    for number in range(rounds):
        for obstacles, simulation in worlds.items():
            times[obstacles].append(step_time(simulation, number))
    steps = [
        {"obstacles": obstacles, "worlds": worlds[obstacles].count, "least": min(found), "median": median(found)}
        for obstacles, found in times.items()
    ]
    settings = {**machine(), "rounds": rounds, "steps": STEPS, "density": DENSITY, "beams": 180}
    return {"settings": settings, "steps": steps}


def curves(numbers: dict[str, Any]) -> Curves:
    """The line of the picture: the least of each size, and up to its median."""
    steps, rounds = numbers["steps"], numbers["settings"]["rounds"]
    return Curves(
        "One step of one world, everything moves",
        f"obstacles, {numbers['settings']['density']:g} a square metre",
        "time of the processor [us]",
        x=[float(step["obstacles"]) for step in steps],
        lines={
            f"least of {rounds}, up to the median": [(step["least"], step["least"], step["median"]) for step in steps]
        },
        y_range=(0.0, 1.2 * max(step["median"] for step in steps)),
    )


def main() -> None:
    """Measure, unless told only to draw, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", action="store_true", help="draw the numbers that are there")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"times that each size is measured ({ROUNDS})")
    options = parser.parse_args()
    if not options.draw:
        with replaced_when_done(NUMBERS) as partial:
            partial.write_text(json.dumps(measured(options.rounds), indent=2) + "\n", encoding="utf-8")
    draw_curves(PICTURE, [curves(json.loads(NUMBERS.read_text(encoding="utf-8")))])


if __name__ == "__main__":
    main()
