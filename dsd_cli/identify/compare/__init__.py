"""How good one model is, where it fails, and on what its error depends."""
