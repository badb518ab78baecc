"""The next experiment: which motion distinguishes explanations of a log, and how well."""
