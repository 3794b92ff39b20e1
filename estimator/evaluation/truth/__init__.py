"""The true body of a robot, which only the scorer may read."""
