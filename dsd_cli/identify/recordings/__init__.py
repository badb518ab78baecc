"""A log made ready for identification."""
