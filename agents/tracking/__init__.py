"""Tracking of what moves, out of scans alone."""
