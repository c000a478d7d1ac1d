"""Checks of what the `layout` of a family from outside gives: the compiled world takes every number as it comes."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, get_args

import numpy as np
from pydantic_core import PydanticCustomError

from bug_gym.checks import shortened
from bug_gym.schema.motions import Motion
from bug_gym.schema.polygons import check_simple
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import check_places

MOTIONS = get_args(get_args(Motion)[0])
"""The classes of the motion laws."""

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
            that crosses itself, a robot or a goal in an obstacle, or chance that does not come from `rng`.
    """
    before = copy.deepcopy(rng) if twice else None
    layout = drawn(crew, rng)
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
    _require_simple(told, layout)
    try:
        check_places(
            crew, layout, partial(is_clear, np.reshape(layout.circles, (-1, 3)), layout.polygons, layout.border)
        )
    except ValueError as error:
        raise ValueError(f"{told}: {error}") from None
    if before is not None and not _are_alike(layout, drawn(crew, before)):
        expected = "expected the same: all chance comes from `rng`, and nothing is kept from world to world"
        raise ValueError(f"{told} gave two layouts for the same arguments, {expected}")
    return layout


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
