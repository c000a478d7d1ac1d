"""The Bug algorithms, one a file."""
