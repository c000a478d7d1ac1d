"""Potential fields, the wall following that leads out of their minima, and the memory grid of the minimum risk method."""
