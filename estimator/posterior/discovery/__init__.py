"""The search for bodies that explain the readings, and the chains that it and the sampler move."""
