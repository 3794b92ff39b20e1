"""The simulated body and what its sensors are exposed to."""
