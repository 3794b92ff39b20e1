"""From the samples of sensors to tilt, touch and clearance."""
