"""Problems: what is known about a robot, and what is to be found; ``library`` ships some."""
