"""Files of the BARN benchmark: its Gazebo worlds, or lines of JSON that say the same."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bug_gym.limits import DATA, FAR, MOST_OBSTACLES, SMALL, STEEP, read_file
from bug_gym.schema.errors import shortened
from bug_gym.worlds.kept import Kept

Map = TypeVar("Map")
"""One world of a benchmark."""


@dataclass(frozen=True)
class BarnMap:
    """One world of the BARN benchmark."""

    start: tuple[float, float, float]
    """x, y [m], heading [rad]."""
    goal: tuple[float, float]
    """x, y [m]."""
    circles: NDArray[np.float64]
    """Cylinders (n, 3): x, y, radius [m]."""
    reference_length: float | None = None
    """Length of the benchmark's own path, which its score refers to [m]; None where the file has none."""


BARN_START = (-2.0, 3.0, math.pi / 2.0)
BARN_GOAL = (-2.0, 13.0)


def _read_worlds(path: str) -> dict[int, BarnMap]:
    """Worlds by number, from a .jsonl with one world a line or a folder of the benchmark's `world_N.world` files.

    Raises:
        ValueError: a line or a file that is no such world (its number is in the message), or none at all.
    """
    source = Path(path)
    worlds = _load_folder(source) if source.is_dir() else load_lines(source, "BARN", _from_json)
    if not worlds:
        raise ValueError(f"{path}: no BARN world found (expected a .jsonl, or a folder with world_N.world files)")
    return worlds


def _files(path: Path, worlds: object) -> list[Path]:
    return [path, *_numbered(path).values()]


load_barn = Kept(_read_worlds, _files)
"""Worlds by number, from a .jsonl or a folder; a ValueError names the line or file that is none."""


def _read(file: Path) -> bytes:
    try:
        return read_file(file, DATA)
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from None


def load_lines(source: Path, kind: str, from_json: Callable[[dict[str, Any]], Map]) -> dict[int, Map]:
    """Worlds by number, from a file with one world of a benchmark (`kind`) a line.

    Raises:
        ValueError: a line that is no such world; its number is in the message.
    """
    worlds: dict[int, Map] = {}
    for number, line in enumerate(_read(source).split(b"\n"), start=1):
        if not line.strip():
            continue
        try:
            data = json.loads(line.decode("utf-8"))
            world = data["world"]
            if not isinstance(world, int) or world in worlds:
                raise ValueError(f"got world {shortened(world)} {'twice' if world in worlds else 'for its number'}")
            worlds[world] = from_json(data)
        except UnicodeDecodeError as error:
            raise ValueError(f"{source}, line {number}: not UTF-8 ({error.reason})") from None
        except json.JSONDecodeError as error:
            raise ValueError(f"{source}, line {number}: not JSON ({error.msg})") from None
        except KeyError as error:
            raise ValueError(f"{source}, line {number}: the world lacks the key {error}") from None
        except RecursionError:
            raise ValueError(f"{source}, line {number}: not a {kind} world (nested too deep)") from None
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"{source}, line {number}: not a {kind} world ({error})") from None
    return worlds


def _from_json(data: dict[str, Any]) -> BarnMap:
    x, y, heading = map(float, data["start"])
    goal_x, goal_y = map(float, data["goal"])
    radius = float(data["cylinder_radius"])
    centres = np.array(data["cylinders"] or np.zeros((0, 2)), dtype=np.float64)
    if centres.ndim != 2 or centres.shape[1] != 2:
        raise ValueError(f"the cylinders have shape {centres.shape}, expected (n, 2)")
    if not (np.isfinite([x, y, heading, goal_x, goal_y, radius]).all() and np.isfinite(centres).all()):
        raise ValueError("a place or the radius is not a finite number")
    if (
        max(abs(x), abs(y), abs(goal_x), abs(goal_y), radius, abs(centres).max(initial=0.0)) > FAR
        or abs(heading) > STEEP
    ):
        raise ValueError(f"a place or the radius is beyond {FAR:g} m, or the heading beyond {STEEP:g} rad")
    if len(centres) > MOST_OBSTACLES:
        raise ValueError(f"got {len(centres):,} cylinders, expected at most {MOST_OBSTACLES:,}")
    if 0.0 < radius < SMALL:
        raise ValueError(f"got the cylinder_radius {radius:g}, expected at least {SMALL:g}")
    if radius <= 0.0:
        raise ValueError(f"got the cylinder_radius {radius:g}, expected a number above 0")
    circles = np.column_stack([centres, np.full(len(centres), radius)])
    return BarnMap((x, y, heading), (goal_x, goal_y), circles, _reference_length(data))


def _reference_length(data: dict[str, Any]) -> float | None:
    """The length of the benchmark's own path [m], where a line tells it."""
    if data.get("reference_length") is None:
        return None
    length = float(data["reference_length"])
    if not SMALL <= length <= FAR:
        raise ValueError(f"got the reference_length {length:g}, expected a number from {SMALL:g} to {FAR:g}")
    return length


def _load_folder(folder: Path) -> dict[int, BarnMap]:
    return {number: load_gazebo(file) for number, file in _numbered(folder).items()}


def _numbered(folder: Path) -> dict[int, Path]:
    """The files of worlds in a folder, by number; none of a path that is no folder."""
    files = {file: re.fullmatch(r"world_(\d+)", file.stem) for file in folder.glob("world_*.world")}
    return {int(number[1]): file for file, number in files.items() if number}


def load_gazebo(file: Path) -> BarnMap:
    """The cylinders of a Gazebo world; start and goal are the benchmark's.

    A cylinder's place is that of its model in the world's saved `state`, else the model's own `pose`.

    Raises:
        ValueError: not XML, no cylinder in it, or a cylinder without a place or a size.
    """
    from xml.etree import ElementTree  # start-up time: only this format of one family needs it

    try:
        root = ElementTree.fromstring(_read(file))
    except (ElementTree.ParseError, LookupError) as error:  # no XML, or in an encoding that nobody knows
        raise ValueError(f"{file}: not a Gazebo world ({error})") from None
    moved = {model.get("name"): model.findtext("pose") for model in root.iterfind(".//state/model")}
    circles = []
    for model in root.iterfind(".//world/model"):
        radius = model.findtext(".//collision/geometry/cylinder/radius")
        if radius is None:
            continue
        pose = moved.get(model.get("name")) or model.findtext("pose")
        if pose is None:
            raise ValueError(f"{file}: the cylinder {shortened(model.get('name'))} has no pose")
        circles.append(_cylinder(pose, radius, f"{file}: the cylinder {shortened(model.get('name'))}"))
    if len(circles) > MOST_OBSTACLES:
        raise ValueError(f"{file}: got {len(circles):,} cylinders, expected at most {MOST_OBSTACLES:,}")
    if not circles:
        raise ValueError(f"{file}: no cylinder in it")
    return BarnMap(BARN_START, BARN_GOAL, np.array(circles))


def _cylinder(pose: str, radius: str, label: str) -> tuple[float, float, float]:
    """x, y, radius [m] of a cylinder from the texts of its pose and radius; `label` names it in errors."""
    came = f"{label} has pose {shortened(pose)} and radius {shortened(radius)}"
    try:
        x, y, *_ = map(float, pose.split())
        size = float(radius)
    except ValueError:
        raise ValueError(f"{came}, expected numbers") from None
    if not (math.isfinite(x) and math.isfinite(y) and 0.0 < size < math.inf):
        raise ValueError(f"{came}, expected finite ones and a size above 0")
    if max(abs(x), abs(y), size) > FAR or size < SMALL:
        raise ValueError(f"{came}, expected places up to {FAR:g} m and a size from {SMALL:g} m on")
    return x, y, size
