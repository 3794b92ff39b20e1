"""Checks of a posterior: its fit, and a simulator."""
