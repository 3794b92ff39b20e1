"""Studies of many runs on simulated robots; first of all the paper's figures and claims."""
