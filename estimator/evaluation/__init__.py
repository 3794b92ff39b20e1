"""How good a run is: against the true body, and on fresh motor programs."""
