"""The control loop, the only thread that touches devices, and what it carries out."""
