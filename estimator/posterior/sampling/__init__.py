"""Samples of the posterior, after each interaction."""
