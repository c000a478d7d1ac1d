"""`bug-gym new policy NAME`: a policy of one's own to begin with: its file, a test of it, and the line that runs it."""

from __future__ import annotations

import argparse
import keyword
import os
import re
from pathlib import Path

from bug_gym.files import replaced_when_done

POLICY = '''"""NAME: toward the goal, or as near to that direction as there is room.

Change `act`. What a policy sees of the robot and its scan: bug_gym.view.View; what it knows of the robot itself:
`self.sensors`. Lengths are in metres, angles in radians, ahead is 0, left is positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bug_gym.policy import Drawing, Memory, ScriptedPolicy
from bug_gym.view import View

TURNS = np.radians([0, *(sign * angle for angle in range(10, 181, 10) for sign in (1, -1))])
"""Directions to try, counted from the goal's [rad]: the nearest to it first."""


@dataclass(frozen=True)
class CLASSParameters:
    """What can be set: `--policies NAME.py:CLASS:room=0.2`."""

    room: float = 0.1
    """Room kept about the body [m]."""
    reach: float = 1.0
    """How far a direction has to be free to be taken [m]."""


@dataclass
class CLASSMemory(Memory):
    """What it remembers of an episode; `mode` and `verdict` are there already."""

    heading_for: tuple[float, float] | None = None
    """Where it drives to just now, x, y in the odometry frame [m], for the picture."""


class CLASS(ScriptedPolicy):
    """Takes the free direction nearest to the goal's."""

    Parameters = CLASSParameters
    parameters: CLASSParameters

    def start(self) -> CLASSMemory:
        """Memory of a new episode."""
        return CLASSMemory(mode="motion_to_goal")

    def act(self, view: View, memory: CLASSMemory) -> tuple[float, float]:
        """The velocity that it wants [m/s], x ahead, y left."""
        bearings = view.goal_bearing + TURNS
        free = view.free_distances(bearings, self.sensors.radius + self.parameters.room)
        wanted = min(self.parameters.reach, view.goal_distance)
        enough = np.flatnonzero(free >= wanted)
        chosen = int(enough[0]) if len(enough) else int(free.argmax())
        memory.mode = "motion_to_goal" if chosen == 0 else "going_round"
        bearing, drive = float(bearings[chosen]), self.sensors.drive
        ahead = min(float(free[chosen]), wanted)
        memory.heading_for = view.to_odometry(ahead * math.cos(bearing), ahead * math.sin(bearing))
        speed = min(drive.max_speed, ahead / drive.step)  # what is free now is not left in this step
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def draw(self, memory: CLASSMemory) -> Drawing:
        """What a picture shows of its mind."""
        return Drawing(points=[(*memory.heading_for, "candidate")] if memory.heading_for else [])
'''

TEST = '''"""What must hold of NAME."""

from pathlib import Path

from bug_gym.evaluation import evaluate

POLICY = f"{Path(__file__).with_name('NAME.py')}:CLASS"


def test_the_open_way_to_the_goal_is_taken() -> None:
    (row,) = evaluate(POLICY, {"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 3]}}, episodes=1)
    assert row.success and row.spl > 0.99


def test_it_drives_into_nothing_that_stands_still() -> None:
    rows = evaluate(POLICY, "static", episodes=5)
    assert "collision" not in [row.outcome for row in rows]


def test_the_same_world_is_driven_in_the_same_way() -> None:
    first, second = (evaluate(POLICY, "static", episodes=2) for _ in range(2))
    assert [(row.outcome, row.path_length) for row in first] == [(row.outcome, row.path_length) for row in second]
'''


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("what", choices=["policy"], help="what to begin")
    parser.add_argument("name", metavar="NAME", help="its name, such as my_bug")
    parser.add_argument("--folder", type=Path, default=Path(), help="where its files go (default: here)")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    name = _checked_name(options.name)
    class_name = "".join(part.capitalize() for part in name.split("_"))
    files = {options.folder / f"{name}.py": POLICY, options.folder / f"test_{name}.py": TEST}
    for path in files:
        if os.path.lexists(path):
            raise ValueError(f"{path} exists already: choose another name or --folder")
    options.folder.mkdir(parents=True, exist_ok=True)
    for path, text in files.items():
        with replaced_when_done(path) as partial:
            partial.write_text(text.replace("NAME", name).replace("CLASS", class_name), encoding="utf-8")
    policy, test = files
    print(f"wrote {policy} and {test}")
    print(f"run it:  bug-gym evaluate --scenario static --policies bug2,{policy}:{class_name}")
    print(f"see it:  bug-gym render {policy}:{class_name} static --out {name}.png")
    print(f"test it: python -m pytest {test}")


def _checked_name(name: str) -> str:
    from bug_gym.agents import known_agents  # loads the compiler

    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise ValueError(f"got {name!r} as a name, expected small letters, digits and _, such as my_bug")
    if name in (known := known_agents()):
        raise ValueError(f"the name {name!r} is taken, by {known[name].entry_point}: choose another one")
    return name
