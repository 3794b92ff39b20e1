"""What ``robotd doctor`` examines."""
