"""Checks of a posterior: its fit, misspecification of the problem, and a simulator."""
