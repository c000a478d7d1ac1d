"""What a robot remembers of still obstacles, and the way through it."""
