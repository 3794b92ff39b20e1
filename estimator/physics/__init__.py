"""Physics back-ends: bodies and motor programs in, predicted readings out."""
