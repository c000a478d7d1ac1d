"""Policies of bug_gym on robots that speak ROS 2, and its worlds for those that do not move yet."""
