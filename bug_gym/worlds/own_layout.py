"""Checks of what the `layout` of a family from outside gives: the compiled world takes every number as it comes."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, get_args

import numpy as np
from pydantic_core import PydanticCustomError

from bug_gym.checks import shortened
from bug_gym.geometry import F64
from bug_gym.schema.motions import Motion, Replay, Waypoints
from bug_gym.schema.polygons import check_simple
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.moving import with_direction
from bug_gym.worlds.places import check_places

MOTIONS = get_args(get_args(Motion)[0])
"""The classes of the motion laws."""

ROUNDING = 1e-9
"""What touches is free, whatever the rounding [m]."""

Drawn = Callable[[Crew, Rng], Any]
"""A family's own `layout`."""


def checked_layout(family: Family, drawn: Drawn, told: str, crew: Crew, rng: Rng, *, twice: bool) -> Layout:
    """The layout that a family from outside draws.

    Args:
        family: the family.
        drawn: draws it.
        told: what an error calls that.
        crew: whom the world is made for.
        rng: all that it may draw from.
        twice: whether to draw it once more, to see whether it is a function of its arguments.

    Raises:
        ValueError: what is no layout, or one that cannot be: numbers that are not finite, arrays of another shape, a ring
            that crosses itself, a border beyond the family's bounds, a robot or a goal in an obstacle or in a robot, a
            mover that walls keep where it must not be, other places than are written, or chance that does not come from `rng`.
    """
    before = copy.deepcopy(rng) if twice else None
    made = layout = drawn(crew, rng)
    if not isinstance(layout, Layout):
        raise ValueError(f"{told} gave {shortened(layout)}, expected a bug_gym.worlds.layout.Layout")
    robots = crew.robots.count
    has_own_goals = family.has_own_goals or any(place.goal for place in crew.robots.places)
    _require_numbers(f"{told}: border", layout.border, (None, 2), least=3)
    _require_numbers(f"{told}: starts", layout.starts, (robots, 3))
    _require_numbers(f"{told}: goals", layout.goals, (robots if has_own_goals else 1, 2))
    _require_numbers(f"{told}: circles", layout.circles, (None, 3))
    _require_radii(f"{told}: circles", np.reshape(layout.circles, (-1, 3))[:, 2])
    for number, rings in enumerate(_listed(f"{told}: polygons", layout.polygons)):
        for ring in _listed(f"{told}: polygons.{number}", rings):
            _require_numbers(f"{told}: polygons.{number}", ring, (None, 2), least=3)
    for number, mover in enumerate(_listed(f"{told}: movers", layout.movers)):
        _require_mover(f"{told}: movers.{number}", mover)
    if layout.target is not None and not isinstance(layout.target, MOTIONS):
        raise ValueError(f"{told}: target: got {shortened(layout.target)}, expected a motion law of bug_gym.config")
    _require_numbers(f"{told}: goal_room", [[layout.goal_room]], (1, 1))
    layout = _in_arrays(layout)
    _require_simple(told, layout)
    _require_within(f"{told}: border", layout.border, family)
    _require_movers_in_the_open(told, layout)
    try:
        check_places(crew, layout)
    except ValueError as error:
        raise ValueError(f"{told}: {error}") from None
    _require_as_written(told, crew, layout)
    _require_apart(f"{told}: starts", crew, layout.starts)
    if before is not None and not _are_alike(made, drawn(crew, before)):
        expected = "expected the same: all chance comes from `rng`, and nothing is kept from world to world"
        raise ValueError(f"{told} gave two layouts for the same arguments, {expected}")
    movers = tuple(replace(mover, motion=with_direction(mover.motion, rng) or mover.motion) for mover in layout.movers)
    return replace(layout, movers=movers, target=with_direction(layout.target, rng))


def _in_arrays(layout: Layout) -> Layout:
    """The same with an array for each list of numbers."""
    return replace(
        layout,
        border=_array(layout.border),
        starts=_array(layout.starts),
        goals=_array(layout.goals),
        circles=_array(layout.circles).reshape(-1, 3),
        polygons=tuple(tuple(map(_array, rings)) for rings in layout.polygons),
        movers=tuple(
            mover if mover.is_circle else replace(mover, outline=_array(mover.outline)) for mover in layout.movers
        ),
    )


def _array(numbers: Any) -> F64:
    return np.asarray(numbers, dtype=np.float64)


def _listed(told: str, several: Any) -> Iterable[Any]:
    if not isinstance(several, (tuple, list)):
        raise ValueError(f"{told}: got {shortened(several)}, expected a tuple of them")
    return several


def _require_numbers(told: str, came: Any, shape: tuple[int | None, int], *, least: int = 0) -> None:
    """Refuse what is no array (shape[0], shape[1]) of finite numbers; None: any number of rows from `least` on."""
    rows, columns = shape
    expected = f"({'k' if rows is None else rows}, {columns}) of finite numbers{f', k at least {least}' * (least > 0)}"
    try:
        numbers = np.asarray(came, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{told}: got {shortened(came)}, expected {expected}") from None
    if numbers.shape == (0,) and least == 0:  # an empty list
        numbers = numbers.reshape(0, columns)
    fits = numbers.ndim == 2 and numbers.shape[1] == columns and len(numbers) >= least and rows in (None, len(numbers))
    if not fits:
        raise ValueError(f"{told}: got shape {numbers.shape}, expected {expected}")
    if not np.isfinite(numbers).all():
        wrong = numbers[~np.isfinite(numbers).all(axis=1)][0]
        raise ValueError(f"{told}: got {wrong.tolist()}, expected {expected}")


def _require_simple(told: str, layout: Layout) -> None:
    """Refuse rings that cross or touch themselves, or have no area: no way about them could be found."""
    import shapely  # slow to load, and most scenarios need none

    outlines = {"border": shapely.Polygon(layout.border)}
    for number, (shell, *holes) in enumerate(layout.polygons):
        outlines[f"polygons.{number}"] = shapely.Polygon(shell, holes)
    for number, mover in enumerate(layout.movers):
        if not mover.is_circle:
            outlines[f"movers.{number}.outline"] = shapely.Polygon(mover.outline)
    for name, outline in outlines.items():
        try:
            check_simple(outline)
        except PydanticCustomError as error:
            raise ValueError(f"{told}: {name}: {error}") from None


def _require_within(told: str, border: F64, family: Family) -> None:
    """Refuse a border beyond the box of the family's bounds, by which what is observed is bounded."""
    xmin, ymin, xmax, ymax = family.box
    beyond = (border < np.subtract((xmin, ymin), ROUNDING)) | (border > np.add((xmax, ymax), ROUNDING))
    if beyond.any():
        came = border[beyond.any(axis=1)][0].tolist()
        raise ValueError(f"{told}: got the corner {came}, expected it within world.bounds, {list(family.box)}")


def _require_movers_in_the_open(told: str, layout: Layout) -> None:
    """Refuse movers that walls turn back, and so would keep for ever where they begin: over the border, or in a polygon."""
    turned_back = [
        (number, mover)
        for number, mover in enumerate(layout.movers)
        if not isinstance(mover.motion, (Waypoints, Replay))
    ]
    if not turned_back:
        return
    import shapely  # slow to load, and most scenarios need none

    border = shapely.Polygon(layout.border)
    polygons = [shapely.Polygon(shell, holes) for shell, *holes in layout.polygons]
    for number, mover in turned_back:
        at = np.asarray(mover.at, dtype=np.float64)
        centre = shapely.Point(at)
        if mover.is_circle:
            is_inside = border.covers(centre) and border.exterior.distance(centre) >= float(mover.outline) - ROUNDING
        else:
            is_inside = border.buffer(ROUNDING).covers(shapely.Polygon(mover.outline + at))
        if not is_inside:
            expected = "expected a place at which it reaches over no border"
            raise ValueError(f"{told}: movers.{number}.at: got {at.tolist()}, {expected}")
        for polygon, outline in enumerate(polygons):
            if outline.contains(centre):
                expected = f"expected a place outside of polygons.{polygon}"
                raise ValueError(f"{told}: movers.{number}.at: got {at.tolist()}, {expected}")


def _require_as_written(told: str, crew: Crew, layout: Layout) -> None:
    """Refuse other starts and goals than those that the scenario writes down for its robots."""
    for number, place in enumerate(crew.robots.places[: crew.robots.count]):
        for name, came, said in (("starts", layout.starts, place.start), ("goals", layout.goals, place.goal)):
            if said is not None and came[number].tolist() != list(said):
                expected = f"expected {list(said)}, as robots.places says"
                raise ValueError(f"{told}: {name}.{number}: got {came[number].tolist()}, {expected}")


def _require_apart(told: str, crew: Crew, starts: F64) -> None:
    """Refuse robots that begin in one another."""
    middles, most = starts[:, :2], 2.0 * crew.robot.reach
    near = np.hypot(*(middles[:, None] - middles[None, :]).transpose(2, 0, 1)) < most
    for one, other in np.argwhere(np.triu(near, 1)).tolist():
        poses = starts[[one, other]].tolist()
        body, its = (crew.robot.body((x, y, heading)) for x, y, heading in poses)
        if any(math.dist(a[:2], b[:2]) < a[2] + b[2] - ROUNDING for a in body for b in its):
            raise ValueError(f"{told}: robots {one} and {other} overlap at {poses}")


def _require_radii(told: str, radii: Any) -> None:
    if (radii <= 0.0).any():
        raise ValueError(f"{told}: got the radius {float(radii.min()):g}, expected one above 0")


def _require_mover(told: str, mover: Any) -> None:
    if not isinstance(mover, Mover):
        raise ValueError(f"{told}: got {shortened(mover)}, expected a bug_gym.worlds.layout.Mover")
    if not isinstance(mover.motion, MOTIONS):
        raise ValueError(f"{told}.motion: got {shortened(mover.motion)}, expected a motion law of bug_gym.config")
    _require_numbers(f"{told}.at", [mover.at], (1, 2))
    if mover.is_circle:
        _require_numbers(f"{told}.outline", [[mover.outline, 0.0]], (1, 2))
        _require_radii(f"{told}.outline", np.asarray([mover.outline], dtype=np.float64))
    else:
        _require_numbers(f"{told}.outline", mover.outline, (None, 2), least=3)


def _are_alike(one: Layout, other: Layout) -> bool:
    """Whether two layouts are the same world."""
    pairs = zip(_parts(one), _parts(other), strict=False)
    return len(list(_parts(one))) == len(list(_parts(other))) and all(np.array_equal(*pair) for pair in pairs)


def _parts(layout: Layout) -> Iterator[Any]:
    """All that a layout consists of, one after the other, as what NumPy can compare."""
    yield from (layout.border, layout.starts, layout.goals, layout.circles, layout.goal_room, str(layout.target))
    for rings in layout.polygons:
        yield len(rings)
        yield from rings
    for mover in layout.movers:
        yield from (mover.outline, mover.at, str(mover.motion))
