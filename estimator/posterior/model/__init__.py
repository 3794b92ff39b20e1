"""The model: what is unknown of a body, and how likely readings are, given one."""
