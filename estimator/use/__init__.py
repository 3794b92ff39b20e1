"""What a known body is good for: poses on demand, and whether the body is still the same."""
