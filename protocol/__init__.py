"""The wire between a robot and its controllers."""
