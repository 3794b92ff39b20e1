"""What is believed of the body after some interactions: samples with weights."""
