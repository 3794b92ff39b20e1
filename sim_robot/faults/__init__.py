"""Faults to inject, and the socket through which they are injected."""
