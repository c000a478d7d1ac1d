"""Teams: several robots of one world that tell one another where they are, one algorithm a file."""
