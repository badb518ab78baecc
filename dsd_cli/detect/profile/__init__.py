"""method = "profile": every delay between the candidates, the best inertia of each, both with their uncertainty."""
