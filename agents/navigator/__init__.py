"""The navigator: a planner where nothing moves, a network among movers."""
