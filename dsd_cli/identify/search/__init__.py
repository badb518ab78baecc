"""Which set of effects explains the recordings."""
