"""Emulated electronics."""
