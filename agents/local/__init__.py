"""Local navigators: they look at what is near and keep no map."""
