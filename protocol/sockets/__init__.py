"""Connections between computers, over TCP and ZeroMQ."""
