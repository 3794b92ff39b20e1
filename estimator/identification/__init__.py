"""The estimation-exploration loop: act, sense, model."""
