"""Reciprocal avoidance: robots that share the work of keeping clear of one another."""
