"""What a robot observed and what models predict: touch, tilt and clearance."""
