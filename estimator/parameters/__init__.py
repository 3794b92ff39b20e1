"""What of a robot may be otherwise than its problem says: one table, a row for each parameter."""
