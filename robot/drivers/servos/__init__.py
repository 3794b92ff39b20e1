"""Drivers of servo boards, and their contract."""
