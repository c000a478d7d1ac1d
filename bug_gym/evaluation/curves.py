"""Curves of success and other shares, with their intervals, as a PNG: a panel a set of lines, or a panel a policy.

Few lines share a panel. Of more than COLORS can tell apart each has a panel of its own, all with the same axes (small
multiples; Tufte, Envisioning Information, 1990): lines that lie on one another are seen, and none is looked for in a legend.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import log
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from bug_gym.checks import install_command
from bug_gym.drawing.clips import PNG
from bug_gym.files import replaced_when_done, writable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Lines(Protocol):
    """A set of lines: see reproductions.result.Curves."""

    @property
    def title(self) -> str:
        """What stands above."""

    @property
    def x_label(self) -> str:
        """What x is, with its unit."""

    @property
    def y_label(self) -> str:
        """What y is, with its unit."""

    @property
    def y_range(self) -> tuple[float, float]:
        """Where the y axis begins and ends."""

    @property
    def x(self) -> Sequence[float]:
        """The values of x."""

    @property
    def lines(self) -> Mapping[str, Sequence[tuple[float, float, float]]]:
        """Value, low and high at each x, by name."""


class Panel(NamedTuple):
    """One pair of axes, and what is drawn there."""

    title: str
    axes_of: Lines
    """Whose labels and ranges it has."""
    lines: Mapping[str, Sequence[tuple[float, float, float]]]


COLORS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#000000")
"""Okabe and Ito's, which those who see no red or no green tell apart, but for their yellow, too pale for a line."""
MARKERS = "os^DvPX"
"""Of each colour, for who sees none."""

LOGARITHMIC = 20.0
"""An axis of positive values whose greatest is so many times the least is logarithmic."""
APART = 0.12
"""Share of an axis between two of its labels at least."""
WIDE, SMALL = (5.2, 3.9), (2.9, 2.3)
"""Size of a panel that lines share, and of one a policy [inches]."""
LEGEND = 0.4
"""Height of a block's legend [inches]."""
WIDE_COLUMNS, SMALL_COLUMNS = 3, 4
"""Most panels side by side."""


def draw_curves(path: Path, curves: Sequence[Lines]) -> None:
    """Draw sets of lines with their intervals into a PNG.

    Raises:
        ImportError: matplotlib is not installed (the extra `report`).
        ValueError: a path that does not end in .png.
    """
    figure = figure_of(curves)
    with replaced_when_done(writable(path, [PNG])) as partial:
        figure.savefig(partial, dpi=100)


def figure_of(curves: Sequence[Lines]) -> Figure:
    """All panels, those with the same axes in one block with its legend above.

    Raises:
        ImportError: matplotlib is not installed (the extra `report`).
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError(f"curves need matplotlib: {install_command('report')}") from error
    is_many = len({name for one in curves for name in one.lines}) > len(COLORS)
    blocks = [of_each_name(group) for group in alike(curves)] if is_many else [[together(one) for one in curves]]
    (width, height), most = (SMALL, SMALL_COLUMNS) if is_many else (WIDE, WIDE_COLUMNS)
    longest = max(map(len, blocks))
    columns = -(-longest // -(-longest // most))  # rows as even as they can be
    rows = [-(-len(block) // columns) for block in blocks]
    figure = Figure(figsize=(width * columns, height * sum(rows) + LEGEND * len(blocks)), layout="constrained")
    parts = figure.subfigures(len(blocks), 1, height_ratios=rows, squeeze=False)[:, 0]
    for part, block, count in zip(parts, blocks, rows, strict=True):
        draw_block(part.subplots(count, columns, squeeze=False).ravel(), block)
        handles = {
            text: handle for axes in part.axes for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        part.legend(handles.values(), handles, loc="outside upper center", ncols=4, frameon=False)
    return figure


def draw_block(grid: Sequence[Axes], block: Sequence[Panel]) -> None:
    """Draw panels into a grid, a name in one colour in all of them; what is left of the grid stays empty."""
    names = list(dict.fromkeys(name for panel in block for name in panel.lines))
    for axes, panel in zip(grid, block, strict=False):
        draw_panel(axes, panel, names)
    for axes in grid[len(block) :]:
        axes.set_axis_off()


def together(curves: Lines) -> Panel:
    """All lines of a set in one panel."""
    return Panel(curves.title, curves, curves.lines)


def alike(curves: Sequence[Lines]) -> list[list[Lines]]:
    """Sets that follow one another and have the same axes."""
    return [
        list(group) for _, group in groupby(curves, lambda one: (one.x_label, one.y_label, one.y_range, list(one.x)))
    ]


def of_each_name(group: Sequence[Lines]) -> list[Panel]:
    """A panel a name; its lines are that of each set."""
    names = dict.fromkeys(name for one in group for name in one.lines)
    return [Panel(name, group[0], {one.title: one.lines[name] for one in group if name in one.lines}) for name in names]


def draw_panel(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    """Draw the lines of a panel, x to scale."""
    x = list(panel.axes_of.x)
    for name, points in panel.lines.items():
        middle, low, high = zip(*points, strict=True)
        style = names.index(name) % len(COLORS)
        color, marker = COLORS[style], MARKERS[style]
        axes.plot(x, middle, color=color, marker=marker, markersize=4, label=name)
        axes.fill_between(x, low, high, color=color, alpha=0.5 / (1 + len(panel.lines)), linewidth=0)
    if is_logarithmic(x):
        axes.set_xscale("log")
        axes.minorticks_off()
    ticks = labelled(x)
    axes.set_xticks(ticks, [f"{value:g}" for value in ticks])
    one = panel.axes_of
    axes.set(title=panel.title, ylim=one.y_range)
    axes.set_xlabel(one.x_label, fontsize="small")
    axes.set_ylabel(one.y_label, fontsize="small")
    axes.grid(alpha=0.3)


def is_logarithmic(x: Sequence[float]) -> bool:
    """Whether an axis of these values is."""
    return min(x) > 0.0 and max(x) / min(x) >= LOGARITHMIC


def labelled(x: Sequence[float]) -> list[float]:
    """The values that get a label: the first and the last, and those between that have room for one."""
    places = [log(value) if is_logarithmic(x) else value for value in x]
    room = APART * (places[-1] - places[0])
    kept = [0]
    for number, place in enumerate(places[1:-1], start=1):
        if place - places[kept[-1]] >= room and places[-1] - place >= room:
            kept.append(number)
    return [x[number] for number in dict.fromkeys([*kept, len(x) - 1])]
