"""Curves: few lines share a panel, of many each has its own; axes are to scale and labels readable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from bug_gym.evaluation.curves import COLORS, MARKERS, figure_of, is_logarithmic, labelled
from bug_gym.reproductions.result import Curves

pytest.importorskip("matplotlib", reason="matplotlib comes with the extra `report`")


def curves(title: str, names: int, x: Sequence[float] = (0.0, 0.01, 0.1)) -> Curves:
    lines = {f"policy {number}": [(0.5, 0.4, 0.6)] * len(x) for number in range(names)}
    return Curves(title, "noise [m]", "success", x, lines)


def test_few_lines_share_the_panel_of_their_set() -> None:
    figure = figure_of([curves("one", len(COLORS)), curves("other", 2)])
    assert [axes.get_title() for axes in figure.axes] == ["one", "other"]
    assert [len(axes.lines) for axes in figure.axes] == [len(COLORS), 2]
    assert len({line.get_color() for line in figure.axes[0].lines}) == len(COLORS) == len({*MARKERS})


def test_of_many_each_has_a_panel_with_the_lines_of_all_sets_that_have_its_axes() -> None:
    figure = figure_of([curves("beacon", 19), curves("odometry", 19), curves("beams", 19, (8, 64, 720))])
    told = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in told] == [f"policy {number}" for number in range(19)] * 2
    assert [len(axes.lines) for axes in told] == [2] * 19 + [1] * 19
    assert len({axes.get_ylim() for axes in told}) == 1 and len({axes.get_xlim() for axes in told}) == 2
    for axes in told[:19]:
        assert [line.get_label() for line in axes.lines] == ["beacon", "odometry"]
    legends = [[text.get_text() for text in part.legends[0].get_texts()] for part in figure.subfigs]
    assert legends == [["beacon", "odometry"], ["beams"]]


def test_values_lie_where_they_are() -> None:
    linear, logarithmic = (figure_of([curves("", 1, x)]).axes[0] for x in ((0.0, 0.01, 0.1), (8.0, 64.0, 720.0)))
    assert (linear.get_xscale(), logarithmic.get_xscale()) == ("linear", "log")
    np.testing.assert_array_equal(linear.lines[0].get_xdata(), [0.0, 0.01, 0.1])


@pytest.mark.parametrize(
    "x", [(0.0, 0.01, 0.02, 0.05, 0.1), (8, 12, 16, 24, 32, 64, 180, 360, 720), (1.0, 2.0, 3.5, 5.0, 10.0), (3.0,)]
)
def test_labels_are_of_values_and_apart_with_both_ends_among_them(x: Sequence[float]) -> None:
    labels = labelled(x)
    assert {x[0], x[-1]} <= {*labels} <= {*x} and labels == sorted({*labels})
    if not is_logarithmic(x) and len(x) > 1:
        assert min(after - before for before, after in zip(labels, labels[1:], strict=False)) >= 0.12 * (x[-1] - x[0])
