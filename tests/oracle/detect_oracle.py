"""The detector by plain loops, straight from the equations of the paper. Imports nothing of the project.

Conventions (docs/how/architecture.md): sample k is measured at t_k, u_k acts on [t_k, t_k+1). The prediction at t_k
uses the means of u(t - L) over the intervals that have ended by t_k, passed through Q. Labels start when the longest
delay line holds only measured u and at least 16 samples have been seen.
"""

import itertools
import math


def held_mean(t, u, begin, end):
    """Mean over [begin, end) of u held from t[i] to t[i+1]; before the log it is held at u[0]."""
    total = 0.0
    edges = [-math.inf, *t[1:], math.inf]
    for i, value in enumerate(u):
        a, b = max(begin, edges[i]), min(end, edges[i + 1])
        if b > a:
            total += value * (b - a)
    return total / (end - begin)


def predictions(t, u, delay, tau, aperture=1, observer_filter=True, sample_time=None):
    """(z, w): Q of the delayed u and Q of u at every sample, by definition."""
    z, w = [], []
    for k in range(len(u)):
        if k == 0:
            z.append(held_mean(t[:1], u[:1], t[0] - delay, t[0] - delay + 1.0))
            w.append(u[0])
            continue
        length = t[k] - t[k - 1]
        if not observer_filter:
            z.append(held_mean(t[: k + 1], u[: k + 1], t[k] - delay, t[k] - delay + length))
            w.append(u[k])
            continue
        first = max(k - aperture, 0)
        mean_z = held_mean(t[: k + 1], u[: k + 1], t[first] - delay, t[k] - delay)
        mean_u = held_mean(t[: k + 1], u[: k + 1], t[first], t[k])
        p = math.exp(-length / tau) if tau > 0 else 0.0
        z.append((1 - p) * mean_z + p * z[-1])
        w.append((1 - p) * mean_u + p * w[-1])
    return z, w


def log_likelihoods(t, u, d, states, jn, tau, rho, window, aperture=1, observer_filter=True, warmup=None):
    """Per sample None (warm-up) or (list of log b per state, number of samples in the window), eq. 14-17.

    states : list of (delay, inertia).
    """
    longest = max(delay for delay, _ in states)
    by_delay = {delay: predictions(t, u, delay, tau, aperture, observer_filter) for delay in {s[0] for s in states}}
    out, first = [], None
    for k in range(len(u)):
        if first is None:
            if k < 16 or (warmup is not None and k < warmup):
                out.append(None)
                continue
            settled = longest + (5 * tau if observer_filter else 0.0)  # Q has forgotten its start
            if warmup is None and t[k - aperture] - t[0] < settled - 1e-9:
                out.append(None)
                continue
            first = k
        begin = max(first, k - window + 1)
        row = []
        for delay, inertia in states:
            z, w = by_delay[delay]
            distance = sum((d[i] - (jn / inertia * z[i] - w[i])) ** 2 for i in range(begin, k + 1))
            row.append(-math.log(math.sqrt(2 * math.pi) * rho) - distance / (2 * rho * rho))
        out.append((row, k - begin + 1))
    return out


def log(x):
    return math.log(x) if x > 0 else -math.inf


def pick(scores, last, states, hold=0.0):
    """argmax; the last label stays on a tie and unless the best leads by more than `hold`.

    Of the states within `hold` (or a tie) of the best, the one that keeps most values of the last label,
    then the best.
    """
    best = max(scores)
    if best == -math.inf:
        return last
    tie = 1e-9 * (1 + abs(best))
    if best - scores[last] <= max(hold, tie):
        return last
    near = [i for i, s in enumerate(scores) if best - s <= max(hold, tie)]

    def kept(i):
        return sum(a == b for a, b in zip(states[i], states[last], strict=True))

    near = [i for i in near if kept(i) == max(kept(j) for j in near)]
    first = max(near, key=lambda i: scores[i])
    return first if sum(scores[first] - scores[i] <= tie for i in near) == 1 else last


def dsd(rows, a, initial, states, hold=0.0):
    """Labels of eq. 18-19 for rows of log_likelihoods; a is the matrix A as nested lists."""
    label, labels = initial, []
    for row in rows:
        if row is not None:
            scores = [log(a[label][i]) + b for i, b in enumerate(row[0])]
            label = pick(scores, label, states, hold)
        labels.append(label)
    return labels


def averaged(rows, a, initial, states, n):
    """Labels of eq. 7-9: the mean of the last n likelihoods, weighted by the transition out of D(t-N)."""
    label, labels, decided, seen = initial, [], [initial] * n, []
    for row in rows:
        if row is not None:
            seen.append(row[0])
            recent = seen[-n:]
            reference = max(max(r) for r in recent)
            scores = []
            for i in range(len(row[0])):
                mean = sum(math.exp(r[i] - reference) for r in recent) / len(recent)
                scores.append(log(a[decided[-n]][i]) + log(mean) + reference)
            label = pick(scores, label, states)
            decided.append(label)
        labels.append(label)
    return labels


def every_path(rows, a, initial):
    """Viterbi and the posterior by enumerating every path of states: [(path, joint probability)]."""
    states = range(len(rows[0]))
    out = []
    for path in itertools.product(states, repeat=len(rows)):
        p, last = 1.0, initial
        for row, state in zip(rows, path, strict=True):
            p *= a[last][state] * math.exp(row[state])
            last = state
        out.append((path, p))
    return out
