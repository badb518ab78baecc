"""The next experiment: which motion tells explanations of a log apart, and how well."""
