"""In what a robot may differ from its problem: one table with a row for each parameter."""
