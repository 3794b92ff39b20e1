"""The daemon of ``robot`` on emulated electronics over a simulated body."""
