"""Damping states (eq. 6 of the paper, from its reference [10]): d(d_hat)/dt as a function of u and d_hat."""
