"""What is to be said: remainder, ties, probability, advice."""
