"""Puts a robot together from its configuration, and serves it."""
