"""The force balance as equations: columns, noise, held-out blocks, solution."""
