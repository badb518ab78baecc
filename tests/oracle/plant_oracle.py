"""The delayed plant and its observers by plain loops, straight from the equations; imports nothing of the package."""

import math


def run_plant(u, sample_time, delay, inertia, viscous=0.0, coulomb=0.0, load=0.0, fine=1e-5):
    """Semi-implicit Euler on a fine grid; (positions, velocities) at t_k. u is held, 0 before the log."""
    per_sample = round(sample_time / fine)
    q = v = 0.0
    positions, velocities = [], []
    for k in range(len(u)):
        positions.append(q)
        velocities.append(v)
        for i in range(per_sample):
            t = (k * per_sample + i + 0.5) * fine - delay
            sample = math.floor(t / sample_time)
            force = (u[sample] if sample >= 0 else 0.0) + load - viscous * v
            if v == 0.0 and abs(force) <= coulomb:
                continue
            direction = v if v != 0.0 else force
            new = v + fine * (force - math.copysign(coulomb, direction)) / inertia
            if coulomb > 0.0 and v * new < 0.0:
                new = 0.0  # passes through rest; the next fine step decides whether it stays
            v = new
            q += fine * v
    return positions, velocities


def observe_velocity(u, velocity, sample_time, nominal, tau):
    p = math.exp(-sample_time / tau) if tau > 0 else 0.0
    d = [0.0]
    for k in range(1, len(u)):
        raw = nominal * (velocity[k] - velocity[k - 1]) / sample_time - u[k - 1]
        d.append(p * d[-1] + (1 - p) * raw)
    return d


def observe_position(u, position, sample_time, nominal, tau):
    p = math.exp(-sample_time / tau) if tau > 0 else 0.0
    d = [0.0, 0.0]
    for k in range(2, len(u)):
        second = (position[k] - 2 * position[k - 1] + position[k - 2]) / sample_time**2
        d.append(p * d[-1] + (1 - p) * (nominal * second - 0.5 * (u[k - 1] + u[k - 2])))
    return d[: len(u)]


def mean_delayed(u, t, delay, k, parts=20000):
    """Mean of u(t - L) over [t_{k-1}, t_k) by brute force; u is held between stamps and at u_0 before."""
    total = 0.0
    for i in range(parts):
        at = t[k - 1] + (i + 0.5) / parts * (t[k] - t[k - 1]) - delay
        value = u[0]
        for j in range(len(t)):
            if t[j] <= at:
                value = u[j]
        total += value
    return total / parts
