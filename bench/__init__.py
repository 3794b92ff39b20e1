"""Benchmarks: ``make bench`` prints what things cost; nothing here is a test."""
