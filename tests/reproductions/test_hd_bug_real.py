"""Recorded streets for the robot of the networks: who crosses them, and how."""

from __future__ import annotations

from pathlib import Path

from bug_gym.agents import AGENTS
from bug_gym.reproductions import hd_bug_real
from bug_gym.reproductions.result import Settings


def test_the_robot_of_the_networks_crosses_the_same_streets_with_each_policy(shared_data: Path) -> None:
    crossings = 2
    table, data, episodes = hd_bug_real.drive_networks(Settings(seeds=crossings, data=shared_data))
    assert [row[:2] for row in table.rows] == [
        [scene, policy] for scene in hd_bug_real.SCENES for policy in hd_bug_real.NETWORKS
    ]
    assert list(data) == [", ".join(row[:2]) for row in table.rows]
    assert len(episodes) == crossings * len(data)
    for label, one in data.items():
        assert one["n"] == sum(one["outcomes"].values()) == crossings
        assert 0 <= one["faults"] <= one["outcomes"].get("collision", 0)
        gap = one["navigator_minus"]
        if label.endswith(hd_bug_real.NETWORKS[0]):
            assert gap is None
            continue
        scene = label.split(", ")[0]
        switch = data[f"{scene}, {hd_bug_real.NETWORKS[0]}"]["success"]
        assert abs(gap["mean"] - (switch - one["success"])) < 1e-12


def test_the_switch_stands_beside_its_planner_and_its_network() -> None:
    switch, planner, network = hd_bug_real.NETWORKS
    assert (switch, planner) == ("navigator", "hd_bug_map") and AGENTS[network].family == "learned"
