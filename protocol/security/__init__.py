"""Keys: who may connect to a robot, and in which role."""
