"""What is missing: compare a model with measurements, diagnose what it lacks, add it, improve."""
