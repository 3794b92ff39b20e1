"""``robotd try``: a person moves one joint and watches every sensor, in the terminal."""
