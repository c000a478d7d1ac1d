"""Explicit worlds from files of other projects: the BARN benchmark's worlds."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BarnMap:
    """One world of the BARN benchmark."""

    start: tuple[float, float, float]
    """x, y [m], heading [rad]."""
    goal: tuple[float, float]
    """x, y [m]."""
    circles: NDArray[np.float64]
    """Cylinders (n, 3): x, y, radius [m]."""


BARN_START = (-2.0, 3.0, math.pi / 2.0)
BARN_GOAL = (-2.0, 13.0)
BARN_RADIUS = 0.075


@lru_cache(maxsize=8)
def load_barn(path: str) -> dict[int, BarnMap]:
    """Worlds by number, from a .jsonl with one world a line or a folder of the benchmark's `world_N.world` files.

    Raises:
        ValueError: a line or a file that is no such world (its number is in the message), or none at all.
    """
    source = Path(path)
    worlds = _load_folder(source) if source.is_dir() else _load_lines(source)
    if not worlds:
        raise ValueError(f"{path}: no BARN world found (expected a .jsonl, or a folder with world_N.world files)")
    return worlds


def _load_lines(source: Path) -> dict[int, BarnMap]:
    worlds = {}
    for number, line in enumerate(source.read_text(encoding="utf-8").splitlines(), start=1):
        if not line.strip():
            continue
        try:
            data = json.loads(line)
            worlds[int(data["world"])] = _from_json(data)
        except json.JSONDecodeError as error:
            raise ValueError(f"{source}, line {number}: not JSON ({error.msg})") from None
        except KeyError as error:
            raise ValueError(f"{source}, line {number}: the world lacks the key {error}") from None
        except (TypeError, ValueError) as error:
            raise ValueError(f"{source}, line {number}: not a BARN world ({error})") from None
    return worlds


def _from_json(data: dict[str, Any]) -> BarnMap:
    x, y, heading = map(float, data["start"])
    goal_x, goal_y = map(float, data["goal"])
    centres = np.array(data["cylinders"], dtype=np.float64).reshape(-1, 2)
    circles = np.column_stack([centres, np.full(len(centres), float(data["cylinder_radius"]))])
    if not np.isfinite(circles).all():
        raise ValueError("a cylinder's place is not a finite number")
    return BarnMap((x, y, heading), (goal_x, goal_y), circles)


def _load_folder(folder: Path) -> dict[int, BarnMap]:
    worlds = {}
    for file in folder.glob("world_*.world"):
        number = re.fullmatch(r"world_(\d+)", file.stem)
        if number:
            worlds[int(number[1])] = load_gazebo(file)
    return worlds


def load_gazebo(file: Path) -> BarnMap:
    """The cylinders of a Gazebo world; start and goal are the benchmark's.

    A cylinder's place is that of its model in the world's saved `state`, else the model's own `pose`.

    Raises:
        ValueError: not XML, or a cylinder without a place.
    """
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as error:
        raise ValueError(f"{file}: not a Gazebo world ({error})") from None
    moved = {model.get("name"): model.findtext("pose") for model in root.iterfind(".//state/model")}
    circles = []
    for model in root.iterfind(".//world/model"):
        radius = model.findtext(".//collision/geometry/cylinder/radius")
        if radius is None:
            continue
        pose = moved.get(model.get("name")) or model.findtext("pose")
        if pose is None:
            raise ValueError(f"{file}: the cylinder {model.get('name')!r} has no pose")
        circles.append((*map(float, pose.split()[:2]), float(radius)))
    if not circles:
        raise ValueError(f"{file}: no cylinder in it")
    return BarnMap(BARN_START, BARN_GOAL, np.array(circles))
