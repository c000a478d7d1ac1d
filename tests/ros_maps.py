"""Maps of ROS's map_server, written for tests."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.worlds.ros_files import FREE, OCCUPIED, UNKNOWN

SHADES = {FREE: 254, UNKNOWN: 205, OCCUPIED: 0}
"""What map_saver writes."""


def picture_of(cells: Any) -> NDArray[np.int64]:
    """Pixels of a map whose rows are given from the lowest up."""
    pixels: NDArray[np.int64] = np.vectorize(SHADES.__getitem__)(np.asarray(cells))[::-1]
    return pixels


def write_pgm(file: Path, pixels: Any, greatest: int = 255, kind: str = "P5") -> None:
    array = np.asarray(pixels)
    height, width = array.shape
    header = f"{kind}\n# made by hand\n{width} {height}\n{greatest}\n".encode()
    if kind == "P2":
        body = "\n".join(" ".join(map(str, row)) for row in array.tolist()).encode()
    else:
        body = array.astype(np.uint8 if greatest < 256 else ">u2").tobytes()
    file.write_bytes(header + body)


def write_map(folder: Path, cells: Any, name: str = "plan", **changes: Any) -> str:
    """A map of these cells, rows from the lowest up; a change to ... leaves the key out."""
    write_pgm(folder / f"{name}.pgm", picture_of(cells))
    return write_yaml(folder, name, **({"image": f"{name}.pgm"} | changes))


def write_yaml(folder: Path, name: str = "plan", **changes: Any) -> str:
    keys = {"image": "plan.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    keys |= {"occupied_thresh": 0.65, "free_thresh": 0.196} | changes
    text = "".join(f"{key}: {value}\n" for key, value in keys.items() if value is not ...)
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return str(path)
