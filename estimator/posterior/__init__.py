"""The posterior: which bodies explain the readings, and how probable each is."""
