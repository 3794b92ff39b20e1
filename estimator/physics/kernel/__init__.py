"""The compiled part of the statics back-end: plain arrays and numbers, described in ``work``."""
