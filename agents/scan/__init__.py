"""Compiled reading of scans for policies."""
