"""Occupancy maps of ROS's map_server: a YAML file and a picture, read as cells and outlined as polygons.

The format is that of ROS 1's map_server and ROS 2's nav2_map_server, mode `trinary`. Outlines run along the borders of
cells and are then drawn straighter by at most half a cell (see `outline`).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from bug_gym.geometry import F64

MAX_CELLS = 16_000_000
"""Largest picture, such as 4,000 x 4,000 pixels: outlining it takes about 1 GB of memory."""

FREE, UNKNOWN, OCCUPIED = 0, 1, 2

DEFAULTS: dict[str, Any] = {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.25, "mode": "trinary"}
REQUIRED = ("image", "resolution", "origin")

Rings = tuple[F64, ...]


@dataclass(frozen=True)
class RosMap:
    """A map as cells."""

    cells: NDArray[np.uint8]
    """FREE, UNKNOWN or OCCUPIED (rows, columns); row 0 is the lowest, unlike in the picture."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float]
    """x, y [m] of the lower left corner and the angle by which the picture is turned about it [rad]."""

    def to_world(self, places: F64) -> F64:
        """Places (n, 2) in cells from the lower left corner, in the world [m]."""
        x, y, angle = self.origin
        u, v = self.resolution * places.T
        if angle == 0.0:
            return np.column_stack([x + u, y + v])
        cos, sin = math.cos(angle), math.sin(angle)
        return np.column_stack([x + cos * u - sin * v, y + sin * u + cos * v])

    def is_free(self, x: float, y: float) -> bool:
        """Whether a point of the world [m] lies in a free cell."""
        left, low, angle = self.origin
        cos, sin = math.cos(angle), math.sin(angle)
        column = math.floor((cos * (x - left) + sin * (y - low)) / self.resolution)
        row = math.floor((cos * (y - low) - sin * (x - left)) / self.resolution)
        rows, columns = self.cells.shape
        return 0 <= row < rows and 0 <= column < columns and bool(self.cells[row, column] == FREE)

    @cached_property
    def free_box(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax [m] of a rectangle that holds all free cells.

        Raises:
            ValueError: there is no free cell.
        """
        rows, columns = np.nonzero(self.cells == FREE)
        if len(rows) == 0:
            raise ValueError("the map has no free cell")
        left, low, right, high = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        x, y = self.to_world(np.array([[left, low], [right, low], [right, high], [left, high]], dtype=np.float64)).T
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def bounds(self) -> Any:
        """Outline of the picture [m]: xmin, ymin, xmax, ymax, or four corners x, y where it is turned."""
        rows, columns = self.cells.shape
        corners = self.to_world(np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64))
        return corners.tolist() if self.origin[2] else [*corners[0].tolist(), *corners[2].tolist()]


# ---------------------------------------------------------------------------------------------- reading


@lru_cache(maxsize=8)
def load_ros_map(path: str) -> RosMap:
    """Read a map from its YAML file.

    Raises:
        ValueError: no such map; the message names the file, the key, what came and what is expected.
    """
    source = Path(path)
    data = _read_yaml(source)
    resolution = _number(data, "resolution", source)
    if resolution <= 0.0:
        raise ValueError(f"{source}: resolution: got {resolution:g}, expected a number above 0 [m]")
    origin = data["origin"]
    if not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_number, origin)):
        raise ValueError(f"{source}: origin: got {origin!r}, expected [x, y, yaw]")
    if data["mode"] != "trinary":
        raise ValueError(f"{source}: mode: got {data['mode']!r}, expected 'trinary'")
    if data["negate"] not in (0, 1):
        raise ValueError(f"{source}: negate: got {data['negate']!r}, expected 0 or 1")
    free, occupied = (_number(data, key, source) for key in ("free_thresh", "occupied_thresh"))
    if free > occupied:
        raise ValueError(f"{source}: free_thresh: got {free:g}, expected at most occupied_thresh ({occupied:g})")
    shade = read_picture(source.parent / str(data["image"]))
    # Dark is occupied, unless the colours are negated.
    occupancy = shade if data["negate"] else 1.0 - shade
    cells = np.full(shade.shape, UNKNOWN, dtype=np.uint8)
    cells[occupancy < free] = FREE
    cells[occupancy > occupied] = OCCUPIED
    x, y, angle = map(float, origin)
    return RosMap(np.ascontiguousarray(cells[::-1]), resolution, (x, y, angle))


def _read_yaml(source: Path) -> dict[str, Any]:
    """The keys of a map's YAML file, those left out at their defaults."""
    try:
        data = yaml.safe_load(source.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, OSError) as error:
        raise ValueError(f"{source}: not the YAML file of a map ({' '.join(str(error).split())})") from None
    if not isinstance(data, dict):
        raise ValueError(f"{source}: got {str(data)[:60]!r}, expected the keys of a map: {', '.join(REQUIRED)}")
    known = (*REQUIRED, *DEFAULTS)
    for key in data:
        if key not in known:
            raise ValueError(f"{source}: unknown key {key!r} (known: {', '.join(known)})")
    for key in REQUIRED:
        if key not in data:
            raise ValueError(f"{source}: the map lacks the key {key!r}")
    return DEFAULTS | data


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _number(data: dict[str, Any], key: str, source: Path) -> float:
    if not _is_number(data[key]):
        raise ValueError(f"{source}: {key}: got {data[key]!r}, expected a number")
    return float(data[key])


def read_picture(file: Path) -> F64:
    """Shades (rows, columns) of a picture, 0 black to 1 white, the top row first: a .pgm, or what pillow reads.

    Raises:
        ImportError: a picture other than .pgm, and pillow isn't installed.
        ValueError: no such picture, or one of more than MAX_CELLS pixels.
    """
    if not file.is_file():
        raise ValueError(f"{file}: no such picture")
    return _read_pgm(file) if file.suffix.lower() == ".pgm" else _read_other(file)


def _check_size(file: Path, width: int, height: int) -> None:
    if width * height > MAX_CELLS:
        raise ValueError(f"{file}: got {width} x {height} pixels, expected at most {MAX_CELLS:,} in all")
    if width * height == 0:
        raise ValueError(f"{file}: got {width} x {height} pixels, expected at least one")


HEADER = re.compile(rb"(P[25])" + 3 * rb"(?:\s|#[^\n]*\n)+(\d+)" + rb"\s")
"""Magic number, width, height and greatest value of a .pgm, with comments between them."""


def _read_pgm(file: Path) -> F64:
    """Shades of a plain (P2) or raw (P5) portable graymap."""
    raw = file.read_bytes()
    header = HEADER.match(raw)
    if header is None:
        raise ValueError(f"{file}: not a .pgm picture (expected P2 or P5, width, height and greatest value)")
    width, height, greatest = (int(number) for number in header.groups()[1:])
    _check_size(file, width, height)
    if not 0 < greatest < 65536:
        raise ValueError(f"{file}: got the greatest value {greatest}, expected 1 to 65535")
    body = raw[header.end() :]
    if header[1] == b"P2":
        body = re.sub(rb"#[^\n]*", b"", body)
        try:
            values = np.array(body.split(), dtype=np.int64)
        except ValueError:
            raise ValueError(f"{file}: a pixel is not a whole number") from None
    else:
        kind = np.dtype(np.uint8 if greatest < 256 else ">u2")
        values = np.frombuffer(body, dtype=kind, count=min(width * height, len(body) // kind.itemsize))
    if len(values) < width * height:
        raise ValueError(f"{file}: got {len(values)} pixels, expected {width} x {height}")
    values = values[: width * height]
    if values.max() > greatest:
        raise ValueError(f"{file}: got a pixel of {values.max()}, expected at most {greatest}")
    shades: F64 = values.reshape(height, width) / greatest
    return shades


def _read_other(file: Path) -> F64:
    """Shades of a picture by pillow: the mean of its channels, transparency too, as map_server takes it."""
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError as error:
        raise ImportError(f"{file}: reading it needs pillow: pip install 'bug-gym[maps]'") from error
    try:
        with Image.open(file) as image:
            _check_size(file, *image.size)
            if image.mode.startswith("I;16"):
                return np.asarray(image, dtype=np.float64) / 65535.0
            colours = "RGBA" if image.has_transparency_data else "RGB"
            pixels = np.asarray(image.convert(colours), dtype=np.float64) / 255.0
    except (UnidentifiedImageError, Image.DecompressionBombError, OSError, SyntaxError) as error:
        raise ValueError(f"{file}: not a picture ({error})") from None
    shades: F64 = pixels.mean(axis=2)
    return shades


# ---------------------------------------------------------------------------------------------- outlines


@lru_cache(maxsize=8)
def load_outlines(path: str, *, unknown_is_wall: bool) -> tuple[Rings, ...]:
    """What is occupied on a map as polygons [m], each its shell and its holes.

    Raises:
        ValueError: no such map.
    """
    plan = load_ros_map(path)
    walls = plan.cells >= (UNKNOWN if unknown_is_wall else OCCUPIED)
    return tuple(tuple(plan.to_world(ring) for ring in rings) for rings in outline(walls))


CHAMFER = 0.3125
"""Share of a cell's side by which two occupied cells that touch only in a corner are joined there."""

STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""Directions 0 to 3 of the sides of cells, x and y, counter-clockwise."""


class _Corners(NamedTuple):
    """Corners of the outlines in order, one outline after the other; occupied cells lie on the left."""

    places: F64
    """x, y (k, 2) [cells]."""
    arriving: NDArray[np.int64]
    """Direction (k,) of the side that ends in the corner."""
    leaving: NDArray[np.int64]
    """Direction (k,) of the side that begins in the corner."""
    is_shared: NDArray[np.bool_]
    """Whether two outlines meet in the corner (k,)."""
    first: NDArray[np.int64]
    """Index (m,) of the first corner of each outline."""
    group: NDArray[np.int64]
    """Number (m,) of the connected cells that each outline bounds."""


def outline(walls: NDArray[np.bool_]) -> list[Rings]:
    """Outlines of the occupied cells as simple polygons, each its shell and its holes (k, 2) [cells].

    Cells that share a side or a corner belong to one polygon. Where an outline steps from one row of cells into the
    next, by a side of length 1 between opposite turns, it is drawn through the middle of that side: slanting walls come
    out straight, and no part of an outline moves by more than half a cell::

              +-----                .-----
              |          ->      .`
        ------+             -----`
    """
    import shapely

    if not walls.any():
        return []
    corners = _trace(walls)
    straight = _assemble(corners, straighten=True)
    is_simple = shapely.is_valid(straight)
    if not is_simple.all():
        straight = np.where(is_simple, straight, _assemble(corners, straighten=False))
    return [_rings(polygon) for polygon in straight]


def _trace(walls: NDArray[np.bool_]) -> _Corners:
    """Walk along all sides between an occupied and a free cell."""
    from scipy import ndimage

    labels, _ = ndimage.label(np.pad(walls, 1), structure=np.ones((3, 3)))
    nodes = walls.shape[1] + 1  # in a row
    key, group = _sides(labels, nodes)
    node, direction = np.divmod(key, 4)
    x_step, y_step = STEPS[direction].T
    ends = node + x_step + nodes * y_step
    after = np.full(len(key), -1)
    # To the right first: so cells that touch in a corner stay on one side of an outline.
    for turn in (3, 0, 1):
        wanted = 4 * ends + (direction + turn) % 4
        found = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        after = np.where((after < 0) & (key[found] == wanted), found, after)
    order, first = _follow(after.tolist())
    leaving = direction[order]
    arriving = leaving[_neighbours(first, len(order))[0]]
    is_corner = leaving != arriving
    node = node[order]
    _, number, count = np.unique(node, return_inverse=True, return_counts=True)
    y, x = np.divmod(node, nodes)
    corners_before = np.concatenate([[0], np.cumsum(is_corner)])
    return _Corners(
        np.column_stack([x, y])[is_corner].astype(np.float64),
        arriving[is_corner],
        leaving[is_corner],
        count[number][is_corner] > 1,
        corners_before[first],
        group[order][first],
    )


def _sides(labels: NDArray[np.int32], nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides between an occupied and a free cell as 4 node + direction (k,), sorted, and the group of each (k,)."""
    inner = slice(1, -1)
    below, above = labels[:-1, inner], labels[1:, inner]
    left, right = labels[inner, :-1], labels[inner, 1:]
    keys, groups = [], []
    # A side begins in the corner of its cell that lies `x`, `y` from the lower or left one of its two nodes.
    for occupied, free, direction, x, y in (
        (above, below, 0, 0, 0),
        (left, right, 1, 0, 0),
        (below, above, 2, 1, 0),
        (right, left, 3, 0, 1),
    ):
        row, column = np.nonzero((occupied > 0) & (free == 0))
        keys.append(4 * ((row + y) * nodes + column + x) + direction)
        groups.append(occupied[row, column])
    key = np.concatenate(keys)
    order = np.argsort(key)
    return key[order], np.concatenate(groups)[order].astype(np.int64)


def _follow(after: list[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides (k,) in the order of walking, given which one comes after each, and where each outline begins (m,)."""
    is_seen = bytearray(len(after))
    order: list[int] = []
    first: list[int] = []
    for begin in range(len(after)):
        if is_seen[begin]:
            continue
        first.append(len(order))
        side = begin
        while not is_seen[side]:
            is_seen[side] = 1
            order.append(side)
            side = after[side]
    return np.array(order), np.array(first)


def _neighbours(first: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Index before and after each of `count` items of rings that begin at `first` (count,)."""
    last = np.append(first[1:], count) - 1
    before, after = np.arange(count) - 1, np.arange(count) + 1
    before[first], after[last] = last, first
    return before, after


def _assemble(corners: _Corners, *, straighten: bool) -> NDArray[np.object_]:
    """Shapely's polygons, one for each group of cells."""
    import shapely

    places, ring = _ring_points(corners, straighten=straighten)
    rings = shapely.linearrings(places, indices=ring)
    is_shell = shapely.is_ccw(rings)
    shells = np.empty(corners.group.max(), dtype=object)
    shells[corners.group[is_shell] - 1] = rings[is_shell]
    polygons: NDArray[np.object_] = shapely.polygons(shells)
    holes: dict[int, list[object]] = {}
    for number, hole in zip(corners.group[~is_shell] - 1, rings[~is_shell], strict=True):
        holes.setdefault(int(number), []).append(hole)
    for number, inner in holes.items():
        polygons[number] = shapely.polygons(shells[number], inner)
    return polygons


def _ring_points(corners: _Corners, *, straighten: bool) -> tuple[F64, NDArray[np.int64]]:
    """Points (n, 2) of all outlines, and the number (n,) of each one's outline."""
    places, count = corners.places, len(corners.places)
    before, after = _neighbours(corners.first, count)
    turn = (corners.leaving - corners.arriving) % 4  # 1 to the left, 3 to the right
    way = places[after] - places
    is_step = (np.abs(way).sum(axis=1) == 1.0) & (turn != turn[after])
    if not straighten:
        is_step[:] = False
    stays = ~is_step & ~is_step[before]
    chamfer = CHAMFER * corners.is_shared[:, None]
    on_arriving, on_leaving = places - chamfer * STEPS[corners.arriving], places + chamfer * STEPS[corners.leaving]
    points = np.stack([on_arriving, on_leaving, places + 0.5 * way], axis=1)
    counts = np.column_stack([stays, stays & corners.is_shared, is_step])
    outlines = np.repeat(np.arange(len(corners.first)), np.diff(np.append(corners.first, count)))
    return _without_straight_angles(points[counts], np.repeat(outlines, counts.sum(axis=1)))


def _without_straight_angles(points: F64, ring: NDArray[np.int64]) -> tuple[F64, NDArray[np.int64]]:
    """Points (n, 2) and their rings' numbers (n,) without the points on straight lines between their neighbours."""
    before, after = _neighbours(np.flatnonzero(np.diff(ring, prepend=-1)), len(ring))
    (x1, y1), (x2, y2) = (points - points[before]).T, (points[after] - points).T
    bends = x1 * y2 != y1 * x2  # exact: all places are multiples of 1/16
    return points[bends], ring[bends]


def _rings(polygon: Any) -> Rings:
    """Shell and holes of a shapely polygon as open rings (k, 2)."""
    import shapely

    return tuple(shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors))
