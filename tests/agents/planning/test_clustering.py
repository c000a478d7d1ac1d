"""Clustering of obstacles: what must merge, what must not be closed, and how much is saved."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from bug_gym.agents.planning.clustering import (
    Cluster,
    cluster,
    default_threshold,
    planner_graph,
    proximity_graph,
)
from bug_gym.agents.planning.mesh import triangulate
from bug_gym.agents.planning.triangulated import Manner, clusters_of, find_way, graph_size
from bug_gym.reproductions import d2t_worlds


def box(x: float, y: float, width: float = 1.0, height: float = 1.0) -> shapely.Polygon:
    return d2t_worlds.block(x, y, width, height)


def parts_of(clusters: Sequence[Cluster]) -> list[shapely.Polygon]:
    return [part for one in clusters for part in one.parts]


U_SHAPE = shapely.Polygon([(0, 0), (6, 0), (6, 4), (5, 4), (5, 1), (1, 1), (1, 4), (0, 4)])


def test_gaps_below_the_threshold_merge_and_wider_ones_do_not() -> None:
    for gap in (0.0, 0.3, 0.499, 0.5, 0.501, 0.7):
        found = cluster([box(0, 0), box(1 + gap, 0)], 0.5)
        assert len(found) == (1 if gap < 0.5 else 2)
    discs = [shapely.Point(x, 0.0).buffer(1.0) for x in (0.0, 2.3)]
    assert len(cluster(discs, 0.5)) == 1 and len(cluster(discs, 0.25)) == 2


@pytest.mark.parametrize("seed", range(12))
def test_every_pair_nearer_than_the_threshold_ends_in_one_cluster(seed: int) -> None:
    task = d2t_worlds.field(seed, 60)
    found = cluster(task.obstacles, 0.6, keep_out=(task.start, task.goal), room=0.3)
    owner = {member: number for number, one in enumerate(found) for member in one.members}
    assert sorted(owner) == list(range(60))
    for i, j in itertools.combinations(range(60), 2):
        if task.obstacles[i].distance(task.obstacles[j]) < 0.6:
            assert owner[i] == owner[j]
    # and it is stable: no two clusters are nearer than the threshold
    for one, other in itertools.combinations(found, 2):
        assert shapely.union_all(one.parts).distance(shapely.union_all(other.parts)) >= 0.6


@pytest.mark.parametrize("seed", range(12))
def test_clustering_never_opens_a_passage(seed: int) -> None:
    task = d2t_worlds.field(seed, 45)
    found = cluster(task.obstacles, 0.6, keep_out=(task.start, task.goal), room=0.3)
    for one in found:
        covered = shapely.union_all(one.parts)
        for member in one.members:
            assert task.obstacles[member].difference(covered).area < 1e-9
    ends = shapely.MultiPoint([task.start, task.goal])
    for one in found:
        if len(one.parts) == 1 and one.parts[0] is not task.obstacles[one.members[0]]:
            assert one.parts[0].distance(ends) > 0.3


def test_hulls_that_come_too_near_to_each_other_merge_in_turn() -> None:
    # The hull of the first two reaches over the third, which is far from either.
    shapes = [box(0, 0, 0.2, 3), box(0.5, 0, 3, 0.2), box(1.0, 1.0, 0.3, 0.3)]
    assert shapes[2].distance(shapes[0]) > 0.5 and shapes[2].distance(shapes[1]) > 0.5
    assert [one.members for one in cluster(shapes, 0.5)] == [(0, 1, 2)]


def test_a_hull_does_not_swallow_the_start_and_a_u_keeps_its_shape_for_its_guest() -> None:
    pair = [box(0, 0, 1, 4), box(1.3, 0, 4, 1)]
    (found,) = cluster(pair, 0.5, keep_out=[(2.0, 1.7)], room=0.3)
    assert found.parts == tuple(pair) and found.members == (0, 1)
    (found,) = cluster(pair, 0.5, keep_out=[(20.0, 20.0)], room=0.3)
    assert len(found.parts) == 1
    alone = cluster([U_SHAPE], 0.5)
    assert alone[0].parts[0].equals(U_SHAPE.convex_hull)
    with_start = cluster([U_SHAPE], 0.5, keep_out=[(3.0, 2.5)], room=0.3)
    assert with_start[0].parts[0].equals(U_SHAPE)
    with_guest = cluster([U_SHAPE, box(2.8, 2.4, 0.4, 0.4)], 0.5)
    assert {one.members: one.parts[0].area for one in with_guest} == {(0,): U_SHAPE.area, (1,): pytest.approx(0.16)}


def test_what_crosses_a_connection_takes_it_out_of_the_planner_graph() -> None:
    shapes = [box(0, 0), box(1.6, 0), box(1.2, -1, 0.2, 3)]
    pairs = proximity_graph(shapes, 0.7)
    assert sorted(map(tuple, pairs.tolist())) == [(0, 1), (0, 2), (1, 2)]
    assert sorted(map(tuple, planner_graph(shapes, pairs).tolist())) == [(0, 2), (1, 2)]
    assert len(cluster(shapes, 0.7)) == 1


def test_the_threshold_closes_what_the_robot_asks_of_a_passage() -> None:
    assert default_threshold(0.25, 0.05) == pytest.approx(0.6)
    assert default_threshold(0.25, 0.0) == pytest.approx(0.55)
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="threshold must be above 0"):
            cluster([box(0, 0)], bad)


def test_the_beach_of_28_things_becomes_9_clusters() -> None:
    beach = d2t_worlds.beach()
    assert len(beach.obstacles) == 28 and len(clusters_of(beach, Manner())) == 9


@pytest.mark.parametrize("seed", range(3))
def test_a_town_of_clusters_needs_a_third_fewer_nodes_and_edges(seed: int) -> None:
    town = d2t_worlds.urban(seed)
    clusters = clusters_of(town, Manner())
    sizes = []
    for shapes in (list(town.obstacles), parts_of(clusters)):
        mesh = triangulate(shapes, np.array([town.start, town.goal]))
        sizes.append(graph_size(mesh, shapes, int(mesh.extra[0])))
    (nodes, edges), (fewer_nodes, fewer_edges) = sizes
    assert len(clusters) <= 0.5 * len(town.obstacles)
    assert fewer_nodes <= nodes * 2 / 3 and fewer_edges <= edges * 2 / 3
    assert find_way(town, Manner("funnel", facets=1)) is not None
