"""Policies that nothing should do worse than: the floor of every comparison."""
