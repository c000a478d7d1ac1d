"""What scenarios are written in, below worlds and config: values, motion laws, the robot and its task, errors.

Defaults live in these models, a YAML file holds the differences from them. Lengths are in metres, times in seconds,
angles in radians.
"""
