"""A node that drives a robot with a policy of bug_gym: /scan, /odom and /goal_pose in, /cmd_vel out."""

from __future__ import annotations

from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym_ros.qos import KEPT
from bug_gym_ros.translation import MessageError, Robot, seconds, stamped


class PolicyNode(Node):
    """Asks a policy at each step of its scenario, and stands where there is no goal or nothing fresh to see.

    Parameters: `policy` and `scenario` as bug_gym's command line has them (the scenario's robot, scanner and step are those of
    the real robot; its world does not matter), `mount` of the scanner (x, y [m], heading [rad]), `clearance` [m],
    `patience` [s], `moving_goal`: whether a goal that comes on the way is the same one, which has moved. A Header on `reset`
    says that the robot was put elsewhere, or its world begun anew: what was stamped before is forgotten, the memory with it.
    """

    def __init__(self) -> None:
        super().__init__("bug_gym_policy")
        scenario = load(self.declare_parameter("scenario", "static").value)
        self.policy = make_policy(self.declare_parameter("policy", "tangent_bug").value, scenario)
        mount = tuple(self.declare_parameter("mount", [0.0, 0.0, 0.0]).value)
        clearance = self.declare_parameter("clearance", 0.02).value
        patience = self.declare_parameter("patience", 0.5).value
        self.robot = Robot(scenario, mount, clearance, patience)
        self.moving_goal = bool(self.declare_parameter("moving_goal", False).value)
        self.state: Any = None
        self.goal: PoseStamped | None = None
        self.waits = True
        self.told = ""
        self.said: set[str] = set()
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Header, "reset", self.on_reset, 10)
        self.create_subscription(LaserScan, "scan", self.on_scan, qos_profile_sensor_data)
        self.create_subscription(Odometry, "odom", self.on_odometry, qos_profile_sensor_data)
        # Two, as a subscription to kept messages hears nobody who keeps none, such as RViz.
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 1)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, KEPT)
        self.timer = self.create_timer(scenario.time.step, self.on_step)

    def now(self) -> float:
        """The node's clock [s]; simulated time where the system has it."""
        return self.get_clock().now().nanoseconds * 1e-9

    def on_scan(self, scan: LaserScan) -> None:
        """A scan has come."""
        try:
            self.robot.hear_scan(scan, self.now())
        except MessageError as error:
            self.tell(str(error))

    def on_odometry(self, odometry: Odometry) -> None:
        """Odometry has come."""
        self.robot.hear_odometry(odometry, self.now())

    def on_reset(self, header: Header) -> None:
        """The robot was put elsewhere: nothing of before counts, but for what is stamped later already."""
        self.robot.restart(seconds(header.stamp))
        self.state, self.waits = None, not self.robot.has_goal
        self.said.clear()
        self.tell("reset")

    def on_goal(self, goal: PoseStamped) -> None:
        """A goal has come: the policy begins anew."""
        if goal == self.goal and stamped(goal) > 0.0:
            return  # the same message, by the other subscription
        self.goal = goal
        try:
            is_new = self.robot.hear_goal(goal, moves=self.moving_goal)
        except MessageError as error:
            self.tell(str(error))
            return
        self.waits = False
        if is_new:
            self.state = None
            self.said.clear()
            self.tell(f"going to {goal.pose.position.x:.2f}, {goal.pose.position.y:.2f}")

    def on_step(self) -> None:
        """One decision."""
        command = Twist()
        silent = self.robot.silent(self.now())
        if self.robot.has_goal and silent:
            self.tell(f"standing: no {silent} for {self.robot.patience} s")
        elif self.robot.is_there:
            self.robot.forget_goal()
            self.tell("arrived")
        elif self.robot.has_goal:
            action, self.state = self.policy.predict(self.robot.observation(), self.state)
            if verdict := getattr(self.state[0] if self.state else None, "verdict", ""):
                self.robot.forget_goal()
                self.tell(f"given up: {verdict}")
            else:
                command.linear.x, command.linear.y, command.angular.z = self.robot.command(action)
        elif self.waits:
            self.tell("standing: no goal yet")
        self.commands.publish(command)

    def tell(self, text: str) -> None:
        """Log something once on the way to a goal, not at each step."""
        self.told = text
        if text not in self.said:
            self.said.add(text)
            self.get_logger().info(text)


def main() -> None:
    """Run the node until it is shut down."""
    rclpy.init()
    node = PolicyNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.commands.publish(Twist())  # the robot stands
        node.destroy_node()
        rclpy.try_shutdown()
