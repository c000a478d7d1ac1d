"""Writes worlds.md and its pictures: `python docs/make_worlds.py` (needs the extra `render`).

What the page says of a family and of its keys are the docstrings in bug_gym/worlds and bug_gym/schema.
"""

from __future__ import annotations

import inspect
import json
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import Any, get_args

import numpy as np

from bug_gym.config import load
from bug_gym.schema.motions import Motion
from bug_gym.schema.movers import Mover, Target
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.schema.values import Part
from bug_gym.worlds import WorldFamily
from bug_gym.worlds.family import Rng

DOCS = Path(__file__).parent
SIZE = 300  # pixels

EXAMPLES: dict[str, tuple[Any, int]] = {
    "empty": ("empty", 0),
    "explicit": ("two_boxes", 0),
    "field": ("dynamic", 1),
    "u_trap": ("u_trap", 0),
    "hook": ("hook", 0),
    "ring": ("ring", 0),
    "maze": ("maze", 1),
    "corridor": ("corridor", 1),
    "rooms": ("rooms", 1),
    "crossing": ("crossing", 1),
    "circle_swap": ("circle_swap", 1),
    "warehouse": ("warehouse_team", 3),
    "forest": ("forest", 1),
    "urban": ("urban", 1),
    "beach": ("beach", 1),
    "oni_wang": ("oni_wang", 0),
    "cellular_automaton": ("cellular_automaton", 1),
}
"""A scenario and a seed for the picture of each family that needs no file."""

PICTURES = {*EXAMPLES, "ros_map"}

EXTRAS = ("hexagon", "terrain", "ackermann")
"""Scenarios whose pictures show what every family may have."""

HEAD = """# Worlds

A scenario's `world` is of one of these families. Each has its keys and their defaults here; a file holds only what
differs from them. `bug-gym show SCENARIO --seed 3 --out world.png` draws a world, and
`bug-gym show SCENARIO --seed 3 --save world.yaml` writes it out with every obstacle, as an `explicit` world. Lengths
are in metres, angles in radians, times in seconds.

`start` is `[x, y, heading]` or `{region: [xmin, ymin, xmax, ymax], heading: ...}`, `goal` is `[x, y]` or
`{region: [...]}`. A world is a function of the seed and of the episode's number. Where a promise is made (a path at
some clearance, gaps of some width) it holds by construction, or worlds are drawn until one keeps it.

This page and its pictures are made by `python docs/make_worlds.py` from the docstrings in `bug_gym/worlds`.
"""

BORDERS = """## Borders that are polygons

`bounds` may also be the corners of a simple polygon, which is then the wall of the world: in every family whose table
says so. Observations are scaled, pictures cut and places drawn by the box around it. `configs/scenarios/hexagon.yaml`:

![hexagon](worlds/hexagon.png)
"""


GROUND = """## Ground that slows robots down

Every family has `regions`. They lie where they are written, in the coordinates of the world, the same for each seed. What
is observed of them is the field `terrain`. `configs/scenarios/terrain.yaml`:

![terrain](worlds/terrain.png)
"""

CAR = """## Robots that steer

A robot with `kinematics: ackermann` drives as a car does, in any family. Its origin lies on the rear axle, so bodies and clear
starts are counted from there. `configs/scenarios/ackermann.yaml`:

![ackermann](worlds/ackermann.png)
"""

MOTION = """## What moves

An `explicit` world lists its `movers`, and `empty` and `explicit` worlds may have a `target` instead of a goal.
"""


def members(union: Any) -> list[type[Part]]:
    """The models of a union, in the order of the schema."""
    return list(get_args(get_args(union)[0]))


def tag(part: type[Part], key: str) -> str:
    """What a model's key `family` or `law` says."""
    return str(get_args(part.model_fields[key].annotation)[0])


def default_of(value: Any) -> str:
    """A default as YAML has it."""
    if value is None:
        return "none"
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def table(part: type[Part]) -> str:
    """Keys, defaults and meanings of a part of a scenario."""
    lines = ["| key | default | meaning |", "|---|---|---|"]
    meanings = part.meanings()
    for key, field in part.model_fields.items():
        if key not in ("family", "law"):
            meaning = meanings[key]
            needed = field.is_required() and "Left out" not in meaning and "left out" not in meaning
            default = "required" if needed else default_of(None if field.is_required() else field.default)
            lines.append(f"| `{key}` | {default} | {meaning} |")
    return "\n".join(lines)


def section(name: str, part: type[Part], level: str = "##") -> str:
    """Heading, docstring, picture and table of a part of a scenario."""
    paragraphs = []
    for paragraph in str(inspect.getdoc(part)).split("\n\n"):
        is_drawing = "+--" in paragraph or "\n#" in paragraph  # which a page would take for a table or a heading
        paragraphs.append(f"```\n{textwrap.dedent(paragraph)}\n```" if is_drawing else paragraph)
    if name in PICTURES:
        paragraphs.append(f"![{name}](worlds/{name}.png)")
    return "\n\n".join([f"{level} {name}", *paragraphs, table(part)]) + "\n"


def page() -> str:
    """The text of worlds.md."""
    families = [section(tag(part, "family"), part) for part in members(WorldFamily)]
    bodies = [section(part.__name__.lower(), part, "###") for part in (Mover, Target)]
    laws = [section(f"law: {tag(part, 'law')}", part, "###") for part in members(Motion)]
    ground = section("region", WeightedRegion, "###")
    return "\n".join([HEAD, *families, BORDERS, GROUND, ground, CAR, MOTION, *bodies, *laws])


def write_example_map(folder: Path) -> str:
    """A picture with slanting walls as a map of ROS's map_server."""
    rng: Rng = np.random.default_rng(4)
    y, x = np.mgrid[:240, :320]
    walls = (x < 4) | (y < 4) | (x >= 316) | (y >= 236)
    for _ in range(14):
        cx, cy, angle = rng.uniform(0, 320), rng.uniform(0, 240), rng.uniform(0.0, np.pi)
        along = (x - cx) * np.cos(angle) + (y - cy) * np.sin(angle)
        across = (y - cy) * np.cos(angle) - (x - cx) * np.sin(angle)
        walls |= (abs(along) < rng.uniform(10, 40)) & (abs(across) < rng.uniform(1, 8))
    pixels = np.where(walls, 0, 254).astype(np.uint8)
    (folder / "plan.pgm").write_bytes(b"P5 320 240 255\n" + pixels.tobytes())
    (folder / "plan.yaml").write_text("image: plan.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return str(folder / "plan.yaml")


def draw_all(folder: Path) -> None:
    """The picture of each family."""
    from bug_gym.drawing.canvas import Canvas
    from bug_gym.drawing.clips import save_png
    from bug_gym.simulation import Simulation

    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        ros_map = {"name": "ros_map", "world": {"family": "ros_map", "path": write_example_map(Path(scratch))}}
        for name, (source, seed) in {
            **EXAMPLES,
            "ros_map": (ros_map, 1),
            **{name: (name, 1) for name in EXTRAS},
        }.items():
            simulation = Simulation(load(source))
            simulation.reset(seeds=[seed])
            save_png(folder / f"{name}.png", Canvas(simulation, size=SIZE).draw(scan=False))


if __name__ == "__main__":
    draw_all(DOCS / "worlds")
    (DOCS / "worlds.md").write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{DOCS / 'worlds.md'} and {len(list((DOCS / 'worlds').glob('*.png')))} pictures\n")
