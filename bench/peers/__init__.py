"""Our search beside public optimisers and samplers: the same readings, the same likelihood."""
