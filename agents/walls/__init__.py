"""The toolbox of the Bug family."""
