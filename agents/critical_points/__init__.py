"""What the bugs of critical points share: virtual circle, open points, legs, what moves, and where tracks meet."""
