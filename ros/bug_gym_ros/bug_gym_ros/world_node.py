"""A node that is a robot in a world of bug_gym: /cmd_vel in, /scan, /odom and its /goal_pose out."""

from __future__ import annotations

import math

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from std_srvs.srv import Empty

from bug_gym import kinematics
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.view import Sensors, View
from bug_gym_ros.qos import KEPT

MOVED = 0.001
"""A goal that has moved so far in the frame of the odometry is told again [m]."""


class WorldNode(Node):
    """Steps a scenario in its own time; a command that has not come anew for half a second is taken as "stand".

    Parameters: `scenario` and `seed`; `odom_frame` and `base_frame`. The service `~/reset` begins the next episode, and a
    Header on `reset` says since when. When an episode ends, its outcome is logged and the world stands still until then.
    """

    def __init__(self) -> None:
        super().__init__("bug_gym_world")
        self.simulation = Simulation(self.declare_parameter("scenario", "static").value)
        scenario = self.simulation.scenario
        if self.simulation.robots != 1:
            raise ValueError(f"{scenario.name} has {self.simulation.robots} robots, expected one")
        self.sensors = Sensors.of(scenario)
        self.seed = int(self.declare_parameter("seed", 0).value)
        self.odom_frame = self.declare_parameter("odom_frame", "odom").value
        self.base_frame = self.declare_parameter("base_frame", "base_link").value
        self.scans = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self.odometry = self.create_publisher(Odometry, "odom", qos_profile_sensor_data)
        self.goals = self.create_publisher(PoseStamped, "goal_pose", KEPT)
        self.resets = self.create_publisher(Header, "reset", 10)
        self.create_subscription(Twist, "cmd_vel", self.on_command, 10)
        self.create_service(Empty, "~/reset", self.on_reset)
        self.begin()
        self.timer = self.create_timer(scenario.time.step, self.on_step)

    def begin(self) -> None:
        """Begin the episode of the seed."""
        self.observation = self.simulation.reset(seeds=[self.seed])[0, 0]
        self.command, self.age, self.is_over = Twist(), 0.0, False
        self.goal: tuple[float, float] | None = None

    def on_command(self, command: Twist) -> None:
        """A command has come."""
        self.command, self.age = command, 0.0

    def on_reset(self, request: Empty.Request, response: Empty.Response) -> Empty.Response:
        """The next episode."""
        self.seed += 1
        self.begin()
        reset = Header()
        reset.stamp, reset.frame_id = self.get_clock().now().to_msg(), self.odom_frame
        self.resets.publish(reset)
        return response

    def on_step(self) -> None:
        """Move by what was commanded since the last step, then tell what is seen."""
        if not self.is_over:
            self.move()
        self.tell()

    def move(self) -> None:
        """One step of the world."""
        self.age += self.sensors.drive.step
        command = self.command if self.age <= 0.5 + self.sensors.drive.step else Twist()
        transition = self.simulation.step(self.action(command)[None, None])
        self.observation = transition.observation[0, 0]
        if transition.terminated.any() or transition.truncated.any():
            self.is_over = True
            outcome = OUTCOMES[self.simulation.world.outcome[0, 0]]
            self.get_logger().info(f"episode {self.seed} has ended: {outcome}")

    def action(self, command: Twist) -> np.ndarray:
        """The action (2,) of a command."""
        drive = self.sensors.drive
        if drive.kinematics == "holonomic":
            return kinematics.steering(drive, (command.linear.x, command.linear.y))
        return kinematics.differential_action(drive, command.linear.x, command.angular.z)

    def tell(self) -> None:
        """Publish what the robot senses."""
        view, stamp = View(self.observation, self.sensors), self.get_clock().now().to_msg()
        scan = LaserScan()
        scan.header.stamp, scan.header.frame_id = stamp, self.base_frame
        angles = self.sensors.angles
        scan.angle_min, scan.angle_max = float(angles[0]), float(angles[-1])
        scan.angle_increment = float(self.sensors.beam_spacing)
        scan.scan_time = float(self.sensors.drive.step)
        scan.range_min, scan.range_max = float(self.simulation.scenario.lidar.min_range), float(self.sensors.range)
        scan.ranges = [value if value < self.sensors.range else math.inf for value in view.ranges.tolist()]
        odometry = Odometry()
        odometry.header.stamp, odometry.header.frame_id = stamp, self.odom_frame
        odometry.child_frame_id = self.base_frame
        pose = odometry.pose.pose
        pose.position.x, pose.position.y = view.position
        pose.orientation.z, pose.orientation.w = math.sin(view.heading / 2.0), math.cos(view.heading / 2.0)
        first, second = view.velocity
        odometry.twist.twist.linear.x = first
        if self.sensors.drive.kinematics == "holonomic":
            odometry.twist.twist.linear.y = second
        else:
            odometry.twist.twist.angular.z = second
        self.odometry.publish(odometry)
        self.scans.publish(scan)
        if self.goal is None or math.dist(self.goal, view.goal_position) > MOVED:
            self.goal = view.goal_position
            goal = PoseStamped()
            goal.header.stamp, goal.header.frame_id = stamp, self.odom_frame
            goal.pose.position.x, goal.pose.position.y = self.goal
            goal.pose.orientation.w = 1.0
            self.goals.publish(goal)


def main() -> None:
    """Run the node until it is shut down."""
    rclpy.init()
    node = WorldNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
