"""Claims among thin cylinders: right on the first seeds, and on those that were wrong once."""

import pytest

from bug_gym.reproductions import cylinder_claims, reproduction
from bug_gym.reproductions.bug_no_way import PROVEN
from bug_gym.reproductions.result import Settings
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import reachable

NAMED = ("com1", "class1", "alg2", "rev3", "bug0_plus", "rev1", "bug2")


def test_bugs_claim_rightly_among_thin_cylinders_on_the_first_seeds() -> None:
    result = reproduction("cylinder-claims")(Settings(seeds=8, policies=NAMED))
    assert result.data["wrong"] == [] and result.holds
    for name, found in result.data["policies"].items():
        assert (found["with a way"], found["without"], found["wrong claims"]) == (6, 2, 0), name
        if name.split()[0] in PROVEN:
            assert (found["reached"], found["unreachable"]) == (6, 2), name


@pytest.mark.parametrize("robot", cylinder_claims.DRIVEN)
@pytest.mark.parametrize("seed", range(8))
def test_a_world_has_a_way_exactly_where_its_answer_says_so(robot: str, seed: int) -> None:
    """The same question, put to the free space in which shortest paths are searched."""
    shut = cylinder_claims.is_shut(seed)
    one = cylinder_claims.scenario(robot, shut=shut)
    layout = draw_layout(one, seed, 0)
    for radius in (one.robot.reach, cylinder_claims.PARAMETERS[robot]["clearance"]):
        way = reachable(
            layout.circles, layout.polygons, layout.border, layout.starts[0, :2], layout.goals[0], radius=radius
        )
        assert way is not shut


def test_seeds_are_driven_once_each() -> None:
    found = [seed for block in cylinder_claims.blocks(101) for seed in block]
    assert sorted(found) == list(range(101))
    assert all(len({cylinder_claims.is_shut(seed) for seed in block}) == 1 for block in cylinder_claims.blocks(101))
