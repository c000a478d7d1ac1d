"""A policy in a world of bug_gym, both over topics: `ros2 launch bug_gym_ros try_out.launch.py policy:=bug2 scenario:=maze`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Both nodes, for the same scenario."""
    scenario = {"scenario": LaunchConfiguration("scenario")}
    policy = {"policy": LaunchConfiguration("policy"), "moving_goal": True}
    return LaunchDescription(
        [
            DeclareLaunchArgument("policy", default_value="tangent_bug"),
            DeclareLaunchArgument("scenario", default_value="static"),
            Node(package="bug_gym_ros", executable="world", parameters=[scenario]),
            Node(package="bug_gym_ros", executable="policy", parameters=[scenario, policy]),
        ]
    )
