"""A body: a tree of parts with lengths, mounts and hinges, as an object and as arrays."""
