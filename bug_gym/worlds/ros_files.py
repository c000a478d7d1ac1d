"""Occupancy maps of ROS's map_server: a YAML file and a picture, read as cells.

The format is that of ROS 1's map_server and ROS 2's nav2_map_server, mode `trinary`.
"""

from __future__ import annotations

import math
import re
import struct
import sys
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from bug_gym.checks import install_command
from bug_gym.geometry import F64
from bug_gym.limits import DATA, FAR, SMALL, STEEP, TEXT, read_file
from bug_gym.schema.errors import shortened
from bug_gym.schema.yaml_text import parse_yaml
from bug_gym.worlds.kept import Kept

MAX_CELLS = 16_000_000
"""Largest picture, such as 4,000 x 4,000 pixels: outlining it takes about 1 GB of memory."""

FREE, UNKNOWN, OCCUPIED = 0, 1, 2

DEFAULTS: dict[str, Any] = {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.25, "mode": "trinary"}
REQUIRED = ("image", "resolution", "origin")


@dataclass(frozen=True, eq=False)
class RosMap:
    """A map as cells."""

    cells: NDArray[np.uint8]
    """FREE, UNKNOWN or OCCUPIED (rows, columns); row 0 is the lowest, unlike in the picture."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float]
    """x, y [m] of the lower left corner and the angle by which the picture is turned about it [rad]."""
    picture: Path
    """Where the cells were read from."""

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
            ValueError: there is no free cell; the message names the picture.
        """
        rows, columns = np.nonzero(self.cells == FREE)
        if len(rows) == 0:
            told = f"{self.picture}: the map has no free cell"
            raise ValueError(f"{told}, expected some lighter than free_thresh says (darker with negate: 1)")
        left, low, right, high = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        x, y = self.to_world(np.array([[left, low], [right, low], [right, high], [left, high]], dtype=np.float64)).T
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def bounds(self) -> Any:
        """Outline of the picture [m]: xmin, ymin, xmax, ymax, or four corners x, y where it is turned."""
        rows, columns = self.cells.shape
        corners = self.to_world(np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64))
        return corners.tolist() if self.origin[2] else [*corners[0].tolist(), *corners[2].tolist()]


def _read_map(path: str) -> RosMap:
    """Read a map from its YAML file.

    Raises:
        ValueError: no such map; the message names the file, the key, what came and what is expected.
    """
    source = Path(path)
    data = _read_yaml(source)
    resolution = _number(data, "resolution", source)
    if resolution <= 0.0:
        raise ValueError(f"{source}: resolution: got {resolution:g}, expected a number above 0 [m]")
    if not SMALL <= resolution <= FAR:
        raise ValueError(f"{source}: resolution: got {resolution:g}, expected {SMALL:g} to {FAR:g} [m]")
    origin = data["origin"]
    if not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_number, origin)):
        raise ValueError(f"{source}: origin: got {shortened(origin)}, expected [x, y, yaw]")
    if max(abs(origin[0]), abs(origin[1])) > FAR or abs(origin[2]) > STEEP:
        reason = f"x and y up to {FAR:g} m and yaw up to {STEEP:g} rad"
        raise ValueError(f"{source}: origin: got {shortened(origin)}, expected {reason}")
    if data["mode"] != "trinary":
        raise ValueError(f"{source}: mode: got {shortened(data['mode'])}, expected 'trinary'")
    if not isinstance(data["image"], str):
        raise ValueError(f"{source}: image: got {shortened(data['image'])}, expected the path of a picture")
    if not isinstance(data["negate"], (int, float)) or data["negate"] not in (0, 1):
        raise ValueError(f"{source}: negate: got {shortened(data['negate'])}, expected 0 or 1")
    free, occupied = (_number(data, key, source) for key in ("free_thresh", "occupied_thresh"))
    if free > occupied:
        raise ValueError(f"{source}: free_thresh: got {free:g}, expected at most occupied_thresh ({occupied:g})")
    # As in map_server the path may be absolute, or lead out of the folder: nothing but a picture is read from there.
    picture = source.parent / data["image"]
    shade = read_picture(picture)
    # Dark is occupied, unless the colours are negated.
    occupancy = shade if data["negate"] else 1.0 - shade
    cells = np.full(shade.shape, UNKNOWN, dtype=np.uint8)
    cells[occupancy < free] = FREE
    cells[occupancy > occupied] = OCCUPIED
    x, y, angle = map(float, origin)
    return RosMap(np.ascontiguousarray(cells[::-1]), resolution, (x, y, angle), picture)


def _files(path: Path, plan: RosMap) -> tuple[Path, Path]:
    return path, plan.picture


load_ros_map = Kept(_read_map, _files)
"""A map by the path of its YAML file; a ValueError names the file, the key, what came and what is expected."""


def _read_yaml(source: Path) -> dict[str, Any]:
    """The keys of a map's YAML file, those left out at their defaults."""
    try:
        raw = read_file(source, TEXT)
        data = parse_yaml(raw.decode("utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, OSError) as error:
        raise ValueError(f"{source}: not the YAML file of a map ({' '.join(str(error).split())})") from None
    if not isinstance(data, dict):
        raise ValueError(f"{source}: got {str(data)[:60]!r}, expected the keys of a map: {', '.join(REQUIRED)}")
    known = (*REQUIRED, *DEFAULTS)
    for key in data:
        if key not in known:
            raise ValueError(f"{source}: unknown key {shortened(key)} (known: {', '.join(known)})")
    for key in REQUIRED:
        if key not in data:
            raise ValueError(f"{source}: the map lacks the key {key!r}")
    return DEFAULTS | data


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= sys.float_info.max  # a whole number may be larger, and then it has no square root either


def _number(data: dict[str, Any], key: str, source: Path) -> float:
    if not _is_number(data[key]):
        raise ValueError(f"{source}: {key}: got {shortened(data[key])}, expected a number")
    return float(data[key])


def read_picture(file: Path) -> F64:
    """Shades (rows, columns) of a picture, 0 black to 1 white, the top row first: a .pgm, or what pillow reads.

    Raises:
        ImportError: a picture other than .pgm, and pillow isn't installed.
        ValueError: no such picture, or one of more than MAX_CELLS pixels.
    """
    try:
        is_file = file.is_file()
    except (OSError, ValueError):  # a name that no file can have
        is_file = False
    if not is_file:
        raise ValueError(f"{shortened(str(file), 300)[1:-1]}: no such picture")
    return _read_pgm(file) if file.suffix.lower() == ".pgm" else _read_other(file)


def _check_size(file: Path, width: int, height: int) -> None:
    if width * height > MAX_CELLS:
        raise ValueError(f"{file}: got {width} x {height} pixels, expected at most {MAX_CELLS:,} in all")
    if width * height == 0:
        raise ValueError(f"{file}: got {width} x {height} pixels, expected at least one")


HEADER = re.compile(rb"(P[25])" + 3 * rb"(?:\s|#[^\n]*\n)+(\d{1,18})" + rb"\s")
"""Magic number, width, height and greatest value of a .pgm, with comments between them."""
HEADER_BYTES = 65536
"""How long that may be."""


def _read_pgm(file: Path) -> F64:
    """Shades of a plain (P2) or raw (P5) portable graymap."""
    try:
        raw = read_file(file, DATA)
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from None
    header = HEADER.match(raw[:HEADER_BYTES])
    if header is None:
        raise ValueError(f"{file}: not a .pgm picture (expected P2 or P5, width, height and greatest value)")
    width, height, greatest = (int(number) for number in header.groups()[1:])
    _check_size(file, width, height)
    if not 0 < greatest < 65536:
        raise ValueError(f"{file}: got the greatest value {greatest}, expected 1 to 65535")
    body = raw[header.end() :]
    if header[1] == b"P2":
        body = re.sub(rb"#[^\n]*", b"", body)
        if re.fullmatch(rb"[\d\s]*", body) is None:
            raise ValueError(f"{file}: a pixel is not a whole number")
        # No list of all pixels: their Python objects would take ten times the memory.
        values = np.fromstring(body, dtype=np.int64, count=-1, sep=" ")
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


FORMATS = ("PNG", "PPM", "BMP", "GIF", "JPEG", "TIFF", "WEBP", "TGA", "PCX")
"""What map_server's library reads; some other formats of pillow's are programs that it would run."""
BROKEN: tuple[type[Exception], ...] = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    OverflowError,
    struct.error,
    zlib.error,
)
"""What pillow raises for broken pictures: each of its readers something of its own."""


def _read_other(file: Path) -> F64:
    """Shades of a picture by pillow: the mean of its channels, transparency too, as map_server takes it."""
    try:
        from PIL import Image
    except ImportError as error:
        raise ImportError(f"{file}: reading it needs pillow: {install_command('maps')}") from error
    bombs = (Image.DecompressionBombError, Image.DecompressionBombWarning)
    with _told_as_no_picture(file, bombs), warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        image = Image.open(file, formats=FORMATS)
    with image:
        _check_size(file, *image.size)
        with _told_as_no_picture(file, bombs):
            if image.mode.startswith("I;16"):
                return np.asarray(image, dtype=np.float64) / 65535.0
            colours = "RGBA" if image.has_transparency_data else "RGB"
            pixels = np.asarray(image.convert(colours), dtype=np.float64) / 255.0
    shades: F64 = pixels.mean(axis=2)
    return shades


@contextmanager
def _told_as_no_picture(file: Path, bombs: tuple[type[Exception], ...]) -> Iterator[None]:
    """Tells what pillow raises in one line."""
    try:
        yield
    except BROKEN + bombs as error:
        raise ValueError(f"{file}: not a picture ({' '.join(str(error).split())})") from None
