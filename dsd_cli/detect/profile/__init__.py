"""method = "profile": every delay between the candidates, the inertia solved in closed form, both with their uncertainty."""
