"""Planners that are given the map: what they read of a world, grids, searches, and how a planned way is followed."""
