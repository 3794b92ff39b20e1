"""A run on disk: everything that must survive, in one SQLite file."""
