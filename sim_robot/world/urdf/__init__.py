"""URDF files: what a body may have in them, and how files of others are normalised."""
