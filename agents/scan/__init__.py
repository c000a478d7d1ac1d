"""Compiled reading of scans for policies: `px`, `py` are the points of a scan in the robot's frame. They see no world."""
