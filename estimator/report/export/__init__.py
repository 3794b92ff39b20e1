"""Bodies in the formats of simulators."""
