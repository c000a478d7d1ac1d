"""Draws what HD-BUG and the map planner see and decide, as Figs. 21 to 24 of the paper do: `python docs/make_hd_bug.py`.

It needs the extra `render`. Four moments of four episodes, one picture each: hd_bug_static.png (the list of light areas,
candidates by cost), hd_bug_terrain.png (the map planner), hd_bug_dynamic.png (movers with their predicted ways) and
hd_bug_moving_target.png; and one episode among movers as hd_bug.gif.
"""

from __future__ import annotations

from pathlib import Path

from bug_gym.config import load
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, save_gif, save_png
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.pictures import film
from bug_gym.evaluation.rollout import Rollout

DOCS = Path(__file__).parent
SIZE = 420  # pixels
DENSE = {"world.obstacles": 45, "lidar.beams": 180}

MOMENTS = (
    ("static", DENSE, 3, 60),
    ("terrain", {}, 0, 70),
    ("dynamic", {"lidar.beams": 180}, 5, 70),
    ("moving_target", {**DENSE, "world.obstacles": 30}, 2, 40),
)
"""Scenario, overrides, seed and steps driven until the picture."""

FILMED = ("dynamic", {"lidar.beams": 180}, 5)
EVERY = 4
"""Steps between two frames of the film."""


def rollout_of(scenario: str, overrides: dict[str, object], seed: int) -> tuple[Rollout, Canvas]:
    """An episode of HD-BUG, over costly ground of the map planner, and where it is drawn."""
    name = "hd_bug_map" if scenario == "terrain" else "hd_bug"
    policy = PolicyEntry.of({"name": name})
    rollout = Rollout(policy, ScenarioEntry(scenario, load(scenario, overrides), range(seed, seed + 1)), [seed])
    return rollout, Canvas(rollout.simulation, size=SIZE, title=name)


def moment(scenario: str, overrides: dict[str, object], seed: int, steps: int) -> Frame:
    """The picture after so many steps."""
    rollout, canvas = rollout_of(scenario, overrides, seed)
    canvas.record()
    for _ in range(steps):
        rollout.advance()
        canvas.record()
    return canvas.draw(rollout.drawings(), scan=False, note=rollout.verdict())


if __name__ == "__main__":
    for described in MOMENTS:
        save_png(DOCS / f"hd_bug_{described[0]}.png", moment(*described))
    rollout, canvas = rollout_of(*FILMED)
    step = rollout.simulation.scenario.time.step
    save_gif(DOCS / "hd_bug.gif", film(rollout, canvas, every=EVERY, scan=False), 2.0 / (step * EVERY))
