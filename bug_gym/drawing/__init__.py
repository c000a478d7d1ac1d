"""Pictures of worlds, and what frames are written to."""
