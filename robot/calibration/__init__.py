"""The guided session behind ``robotd calibrate``; it writes no file, and leaves the robot holding."""
