"""The guided session behind ``robotd calibrate``: it writes no file; at its end the robot holds."""
