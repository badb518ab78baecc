/* The detector's inner loop, eq. 14-19 of the paper, one sample at a time.
 *
 * `advance` takes one sample through three stages:
 *   1. predict   per delay and effect values ("group"): z = Q{ u(t-L) + forces }, and y = Q u + d_hat
 *   2. window    per state: squared residual (y - (Jn/J) z)^2, summed over the last M samples
 *   3. decide    argmax of log a + log b, ties and `hold` keep the last label; lead, probability
 * `advance_tile` takes four successive samples at once through the same operations in the same order: what is three
 * short vectors of states for one sample, with sums across their lanes, is one vector of samples per state for four. So
 * a stream, an array and any chunking give the same bits. numpy_kernel.py is the readable twin: same numbers, label by
 * label.
 *
 * The window is a two-block sum anchored at multiples of M: prefix of the current block + suffix of the one before.
 * Nothing is ever subtracted, so a spike of 1e9 leaves no trace, and M costs nothing.
 *
 * CPython limited API and buffers only: no NumPy headers. The inertias of a group are padded to a multiple of LANES.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 4

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define AVX2 __attribute__((target("avx2")))    /* a second copy of the loops, where the processor has it */
#endif
#define INLINE static inline __attribute__((always_inline))

enum { UNIFORM = 0, STICKY = 1, MATRIX = 2 };
/* what a row of `matrix` rests on */
enum { WARMUP = 0, PARTIAL = 1, FULL = 2 };

typedef struct {
    /* fixed */
    Py_ssize_t delays, combos, groups, inertias, states, padded, axes, window, warmup_rows;
    Py_ssize_t width;               /* lanes of a group: inertias, padded; no division in the loops */
    int timed, filtered, aperture, transition;
    double T, tau, pole, sign, c, ll_const, ll_floor, hold, confidence, lead, log_stay, log_move, warmup_time;
    double *delay, *frac;
    int64_t *whole;
    int32_t *state_of;              /* per lane */
    double *alpha, *log_a;          /* Jn/J per lane of a group; log A, a row per lane */
    double *axis;                   /* axes x padded: which value of the axis a state has */
    /* carried */
    int64_t k, count;               /* samples seen, samples that entered the window */
    int warm;
    double start;                   /* first stamp (timed) */
    Py_ssize_t label, slot;         /* last label (a lane), place in the block of the window */
    double *u, *t;                  /* history rings, size cap (power of two) */
    int64_t cap, *pointer;          /* per delay: the piece of u where the next interval starts (timed) */
    double w, u_mean, interval;     /* Q u; last interval's mean u and length (aperture 2) */
    double *z, *raw;                /* per group: Q z, last raw z */
    double *prefix, *ring, *dist, *cost, *row;
    double *z4, *dist4, *row4;      /* the same for LANES samples: a vector of samples in place of each number */
    void *block;                    /* the one aligned allocation behind these arrays */
} Core;

typedef struct { double ll, probability; int32_t state; uint8_t confident, status; } Result;

/* States are numbered group by group, inertia innermost; a group's inertias are padded to whole vectors. */
INLINE Py_ssize_t lane(const Core *q, Py_ssize_t state) {
    return state / q->inertias * q->width + state % q->inertias;
}

/* ---- stage 1: prediction ------------------------------------------------------------------------------------ */

INLINE double history(const double *ring, int64_t cap, int64_t k) { return ring[(k < 0 ? 0 : k) & (cap - 1)]; }

/* mean of u(t-L) over one interval: exact under the zero-order hold for any real L */
INLINE double regular_mean(const Core *q, int64_t last, Py_ssize_t g) {
    const int64_t n = last - q->whole[g];
    return (1.0 - q->frac[g]) * history(q->u, q->cap, n) + q->frac[g] * history(q->u, q->cap, n - 1);
}

static double timed_mean(Core *q, double from, double to, int64_t last, Py_ssize_t g) {
    double a = from - q->delay[g], b = to - q->delay[g], sum = 0.0, position = a;
    int64_t j = q->pointer[g];
    while (j < last && q->t[(j + 1) & (q->cap - 1)] <= b) {
        const double next = q->t[(j + 1) & (q->cap - 1)];
        if (next > position) {
            sum += q->u[j & (q->cap - 1)] * (next - position);
            position = next;
        }
        j++;
    }
    sum += q->u[j & (q->cap - 1)] * (b - position);
    q->pointer[g] = j;
    return sum / (b - a);
}

/* the force that accelerates: friction has a budget b, opposes motion (s = mean sign of v) and balances at rest */
INLINE double combine(double drive, double force, double budget, double s) {
    const double applied = drive + force;
    if (isinf(s)) return 0.0;       /* the speed turns: what friction does is not known, Session took it out of d_hat */
    if (s == s) return applied - budget * s;
    if (applied > budget) return applied - budget;
    if (applied < -budget) return applied + budget;
    return 0.0;
}

static int grow(Core *q) {
    int64_t oldest = q->k, size = q->cap, i;
    Py_ssize_t g;
    double *u, *t;
    for (g = 0; g < q->delays; g++) if (q->pointer[g] < oldest) oldest = q->pointer[g];
    if (q->k - oldest + 2 < q->cap) return 0;
    size *= 2;
    u = malloc(sizeof(double) * size);
    t = malloc(sizeof(double) * size);
    if (!u || !t) { free(u); free(t); return -1; }
    for (i = oldest; i < q->k; i++) {
        u[i & (size - 1)] = q->u[i & (q->cap - 1)];
        t[i & (size - 1)] = q->t[i & (q->cap - 1)];
    }
    free(q->u); free(q->t);
    q->u = u; q->t = t; q->cap = size;
    return 0;
}

/* z per group and y's part w for sample k; history already holds u_k (and t_k) */
INLINE void predict(Core *q, const double *force, const double *budget, double s) {
    const int64_t k = q->k, last = q->filtered ? k - 1 : k, mask = q->cap - 1;
    double p = q->pole, mean_u, length = q->T, share = 0.5, from = 0.0, to = 0.0;
    Py_ssize_t g, e;
    if (q->timed && k > 0) {
        length = q->t[k & mask] - q->t[(k - 1) & mask];
        if (q->tau > 0.0) p = exp(-length / q->tau);
        from = q->filtered ? q->t[(k - 1) & mask] : q->t[k & mask];
        to = from + length;
    }
    mean_u = history(q->u, q->cap, last);
    if (q->aperture == 2 && k > 1) {
        share = length / (length + q->interval);
        const double both = share * mean_u + (1.0 - share) * q->u_mean;
        q->u_mean = mean_u;
        mean_u = both;
    } else {
        q->u_mean = mean_u;
    }
    q->interval = length;
    if (!q->filtered || k == 0) p = 0.0;
    q->w = (1.0 - p) * mean_u + p * q->w;
    if (!q->timed && !force && q->aperture == 1 && q->combos == 1) {     /* the same as below, without the cases */
        const double keep = 1.0 - p;
        for (g = 0; g < q->delays; g++) q->z[g] = keep * regular_mean(q, last, g) + p * q->z[g];
        return;
    }
    for (g = 0; g < q->delays; g++) {
        double m;
        if (!q->timed) m = regular_mean(q, last, g);
        else m = k > 0 ? timed_mean(q, from, to, q->filtered ? k - 1 : k, g) : mean_u;
        for (e = 0; e < q->combos; e++) {
            const Py_ssize_t i = g * q->combos + e;
            double raw = force ? combine(m, force[e], budget[e], s) : m;
            const double previous = q->raw[i];
            q->raw[i] = raw;
            if (q->aperture == 2 && k > 1) raw = share * raw + (1.0 - share) * previous;
            q->z[i] = (1.0 - p) * raw + p * q->z[i];
        }
    }
}

/* ---- vectors ------------------------------------------------------------------------------------------------- */

/* GCC's vector extensions: the loops below do not vectorise by themselves, because of the running minima. */
typedef double v4 __attribute__((vector_size(32), aligned(32), may_alias));
typedef int64_t i4 __attribute__((vector_size(32), aligned(32), may_alias));

INLINE v4 splat(double x) { return (v4){x, x, x, x}; }
INLINE v4 pick(i4 mask, v4 a, v4 b) { return (v4)((mask & (i4)a) | (~mask & (i4)b)); }
/* `wide` (a constant: AVX2 or not) is for the two that GCC has no one instruction for, which here are a third of all */
INLINE v4 smaller(v4 a, v4 b, const int wide) {
#ifdef AVX2
    if (wide) {
        v4 m;
        __asm__("vminpd %2, %1, %0" : "=x"(m) : "x"(a), "xm"(b));
        return m;
    }
#endif
    return pick(a < b, a, b);
}
INLINE int any(i4 mask, const int wide) {
#ifdef AVX2
    if (wide) {
        int bits;
        __asm__("vmovmskpd %1, %0" : "=r"(bits) : "x"(mask));
        return bits;
    }
#endif
    return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
}
/* a 4 x 4 matrix by columns becomes one by rows */
INLINE void turn(v4 *a, v4 *b, v4 *c, v4 *d) {
    const v4 ab0 = __builtin_shuffle(*a, *b, (i4){0, 4, 2, 6}), ab1 = __builtin_shuffle(*a, *b, (i4){1, 5, 3, 7});
    const v4 cd0 = __builtin_shuffle(*c, *d, (i4){0, 4, 2, 6}), cd1 = __builtin_shuffle(*c, *d, (i4){1, 5, 3, 7});
    *a = __builtin_shuffle(ab0, cd0, (i4){0, 1, 4, 5});
    *b = __builtin_shuffle(ab1, cd1, (i4){0, 1, 4, 5});
    *c = __builtin_shuffle(ab0, cd0, (i4){2, 3, 6, 7});
    *d = __builtin_shuffle(ab1, cd1, (i4){2, 3, 6, 7});
}
INLINE double lowest(v4 m) {
    const double a = m[0] < m[1] ? m[0] : m[1], b = m[2] < m[3] ? m[2] : m[3];
    return a < b ? a : b;
}

/* `predict` of LANES samples of the plainest case, whose u are in the history already */
INLINE void predict_tile(Core *q, v4 *w) {
    const int64_t first = q->filtered ? q->k - 1 : q->k, mask = q->cap - 1;
    const double p = q->filtered ? q->pole : 0.0, keep = 1.0 - p;
    v4 *restrict tile = (v4 *)q->z4;
    Py_ssize_t g;
    int i;
    for (i = 0; i < LANES; i++) {
        q->u_mean = history(q->u, q->cap, first + i);
        (*w)[i] = q->w = keep * q->u_mean + p * q->w;
    }
    for (g = 0; g < q->delays; g++) {
        const double frac = q->frac[g], rest = 1.0 - frac;
        const int64_t n = first - q->whole[g];      /* at least 1: the delay lines are full */
        double z = q->z[g], before = q->u[(n - 1) & mask];
        v4 all;
        for (i = 0; i < LANES; i++) {
            const double now = q->u[(n + i) & mask];
            z = keep * (rest * now + frac * before) + p * z;
            all[i] = z;
            before = now;
        }
        q->z[g] = z;
        tile[g] = all;
    }
    q->interval = q->T;
    q->k += LANES;
}

/* ---- stage 2: windowed distances, eq. 15-17 ------------------------------------------------------------------ */

/* Padding lanes are at infinity, in the prefix and so in every distance. */
static void clear_prefix(Core *q) {
    Py_ssize_t g, h;
    double *next = q->prefix;
    for (g = 0; g < q->groups; g++) for (h = 0; h < q->width; h++) *next++ = h < q->inertias ? 0.0 : INFINITY;
}

/* Suffix sums of `count` vectors of every row, in registers from the last row to the first. */
INLINE void sum_up(v4 *first, Py_ssize_t nv, Py_ssize_t rows, const int count) {
    v4 sum[LANES] = {splat(0.0), splat(0.0), splat(0.0), splat(0.0)}, *a = first + rows * nv;
    int i;
    while (a > first) {
        a -= nv;
        for (i = 0; i < count; i++) a[i] = sum[i] = a[i] + sum[i];
    }
}

/* The block of M squares is complete: turn it into suffix sums, and start a new prefix. */
INLINE void turn_block(Core *q) {
    const Py_ssize_t nv = q->padded / LANES;
    v4 *ring = (v4 *)q->ring;
    Py_ssize_t v;
    for (v = 0; v + LANES <= nv; v += LANES) sum_up(ring + v, nv, q->window, LANES);
    if (nv - v == 3) sum_up(ring + v, nv, q->window, 3);
    else for (; v < nv; v++) sum_up(ring + v, nv, q->window, 1);
    clear_prefix(q);
}

/* Fills dist, and the smallest distance per group (`row`). Returns the smallest of all. */
INLINE double window(Core *q, double y, int missing, const Py_ssize_t nh, const int wide) {
    const Py_ssize_t groups = q->groups;
    v4 *restrict slot = (v4 *)(q->ring + q->slot * q->padded), *restrict prefix = (v4 *)q->prefix;
    v4 *restrict dist = (v4 *)q->dist;
    const v4 *restrict suffix = (v4 *)(q->ring + (q->slot + 1) * q->padded), *restrict alpha = (v4 *)q->alpha;
    const v4 yy = splat(missing ? 0.0 : y);
    const double *restrict zs = q->z;
    double *restrict row = q->row;
    double best = INFINITY, lowest_of_group;
    Py_ssize_t g, h, v = 0;
    for (g = 0; g < groups; g++) {
        const v4 z = splat(missing ? 0.0 : zs[g]);
        v4 low = splat(INFINITY);
        for (h = 0; h < nh; h++, v++) {
            const v4 r = yy - alpha[h] * z, square = r * r, sum = prefix[v] + square, d = sum + suffix[v];
            prefix[v] = sum;
            slot[v] = square;
            dist[v] = d;
            low = smaller(d, low, wide);
        }
        row[g] = lowest_of_group = lowest(low);
        best = lowest_of_group < best ? lowest_of_group : best;
    }
    q->count++;
    if (++q->slot == q->window) {
        q->slot = 0;
        turn_block(q);
    }
    return best;
}

/* `window` of LANES samples within one block of M. Fills dist4 (per vector of states one vector for each sample) and row4
 * (per group a vector of samples). Returns the smallest of all, by sample. */
INLINE v4 window_tile(Core *q, v4 y, const Py_ssize_t nh, const int wide) {
    const Py_ssize_t groups = q->groups, nv = q->padded / LANES;
    v4 *restrict ring = (v4 *)(q->ring + q->slot * q->padded), *restrict prefix = (v4 *)q->prefix;
    v4 *restrict dist = (v4 *)q->dist4, *restrict row = (v4 *)q->row4;
    const v4 *restrict alpha = (v4 *)q->alpha, *restrict z = (v4 *)q->z4;
    const v4 y0 = splat(y[0]), y1 = splat(y[1]), y2 = splat(y[2]), y3 = splat(y[3]);
    v4 best = splat(INFINITY);
    Py_ssize_t g, h;
    for (g = 0; g < groups; g++) {
        const v4 z0 = splat(z[g][0]), z1 = splat(z[g][1]), z2 = splat(z[g][2]), z3 = splat(z[g][3]);
        v4 low0 = splat(INFINITY), low1 = low0, low2 = low0, low3 = low0;
        for (h = 0; h < nh; h++, ring++, prefix++, dist += LANES) {
            const v4 r0 = y0 - alpha[h] * z0, s0 = r0 * r0, r1 = y1 - alpha[h] * z1, s1 = r1 * r1;
            const v4 r2 = y2 - alpha[h] * z2, s2 = r2 * r2, r3 = y3 - alpha[h] * z3, s3 = r3 * r3;
            const v4 p0 = *prefix + s0, p1 = p0 + s1, p2 = p1 + s2, p3 = p2 + s3;
            const v4 d0 = p0 + ring[nv], d1 = p1 + ring[2 * nv], d2 = p2 + ring[3 * nv], d3 = p3 + ring[4 * nv];
            ring[0] = s0; ring[nv] = s1; ring[2 * nv] = s2; ring[3 * nv] = s3;
            dist[0] = d0; dist[1] = d1; dist[2] = d2; dist[3] = d3;
            *prefix = p3;
            low0 = smaller(d0, low0, wide); low1 = smaller(d1, low1, wide);
            low2 = smaller(d2, low2, wide); low3 = smaller(d3, low3, wide);
        }
        turn(&low0, &low1, &low2, &low3);
        row[g] = smaller(smaller(low0, low1, wide), smaller(low2, low3, wide), wide);
        best = smaller(row[g], best, wide);
    }
    q->count += LANES;
    q->slot += LANES;
    if (q->slot == q->window) {
        q->slot = 0;
        turn_block(q);
    }
    return best;
}

/* ---- stage 3: decision, eq. 18-19 ---------------------------------------------------------------------------- */

/* States this many nats from the best add less than 3e-9 each to the sum of all. */
#define FAR 20.0
#define BITS_PER_NAT 1.4426950408889634

/* 2^x for -1000 < x <= 0, relative error below 1.1e-7, 2^0 = 1: enough for a probability; below that it is any bits.
 * 2^f = 1 + c1 f + ... + c5 f^5 for |f| <= 1/2 has the smallest largest relative error. */
INLINE v4 quick_exp2(v4 x) {
    const v4 shifted = x + splat(6755399441055744.0);      /* 1.5 * 2^52: the last bits are round(x) */
    const v4 f = x - (shifted - splat(6755399441055744.0));
    v4 p = splat(0.0013254602433094601);
    p = p * f + splat(0.00967199918070571);
    p = p * f + splat(0.055507793245535925);
    p = p * f + splat(0.24022231907060837);
    p = p * f + splat(0.6931469302343756);
    p = p * f + splat(1.0);
    return (v4)((i4)p + ((i4)shifted << 52));
}

/* exp of what a state lies behind the best in nats (`unit` is in bits); 0 beyond `far` */
INLINE v4 share(v4 best, v4 cost, v4 far, v4 unit) {
    return pick(cost <= far, quick_exp2((best - cost) * unit), splat(0.0));
}

/* The cost -log p of eq. 18 up to a constant, so that the smallest wins: with a uniform A the distance itself, in
 * units of `unit` nats. Returns the smallest. */
INLINE double costs(Core *q, double nearest, const double **cost, double *unit) {
    const double *restrict dist = q->dist;
    double *restrict own = q->cost, best = INFINITY;
    const double *restrict row = q->transition == MATRIX ? q->log_a + q->label * q->padded : NULL;
    Py_ssize_t s;
    if (q->transition == UNIFORM) {
        *cost = q->dist;
        *unit = q->c;
        return nearest;
    }
    for (s = 0; s < q->padded; s++) own[s] = dist[s] * q->c - (row ? row[s] : q->log_move);
    if (!row) own[q->label] = dist[q->label] * q->c - q->log_stay;
    for (s = 0; s < q->padded; s++) best = own[s] < best ? own[s] : best;
    *cost = q->cost;
    *unit = 1.0;
    return best;
}

/* where state s of one sample stands: in an array of its own (samples = 1), or among LANES samples */
INLINE Py_ssize_t place(Py_ssize_t s, const int samples) { return s / LANES * LANES * samples + s % LANES; }

/* Eq. 19. The last label stays unless another leads by more than `hold`. Of all states within `hold` (or a tie) of the
 * best, the one that changes fewest axes is taken, then the best of these: u constant tells inertias apart, not delays, so
 * the delay stays. On a tie again the last label stays. `cost` and `row` (per group) belong to one of `samples`. */
INLINE void choose(Core *q, const double *cost, const double *row, const int samples, double unit, double best) {
    const double tie = 1e-9 * (1.0 + fabs(best) * unit);
    const Py_ssize_t last = q->label;
    const Py_ssize_t width = q->width;
    const double near = q->hold > tie ? q->hold : tie;
    Py_ssize_t g, s, a, found = last, most = -1;
    double lowest_cost = INFINITY;
    if (!((cost[place(last, samples)] - best) * unit > near)) return;
    for (g = 0; g < q->groups; g++) {
        if (q->transition == UNIFORM && !((row[g * samples] - best) * unit <= near)) continue;
        for (s = g * width; s < (g + 1) * width; s++) {
            const double mine = cost[place(s, samples)];
            Py_ssize_t same = 0;
            if (!((mine - best) * unit <= near)) continue;
            for (a = 0; a < q->axes; a++) same += q->axis[a * q->padded + s] == q->axis[a * q->padded + last];
            if (same < most) continue;
            if (same == most && fabs(mine - lowest_cost) * unit <= tie) {
                found = last;       /* the lower of the two is what the states to come have to beat */
                if (mine < lowest_cost) lowest_cost = mine;
                continue;
            }
            if (same > most || mine < lowest_cost) { found = s; most = same; lowest_cost = mine; }
        }
    }
    q->label = found;
}

/* Is the label's lead over the best state with another value, on every axis, at least `confidence` nats? Any other state
 * has another value on some axis: none may be nearer than that. */
INLINE int leads(const Core *q) {
    const double limit = q->dist[q->label] + q->lead;
    Py_ssize_t g, s;
    for (g = 0; g < q->groups; g++) {
        if (!(q->row[g] < limit)) continue;
        for (s = g * q->width; s < (g + 1) * q->width; s++) if (q->dist[s] < limit && s != q->label) return 0;
    }
    return 1;
}

INLINE void decide(Core *q, int64_t count, double nearest, const Py_ssize_t nh, Result *out) {
    const Py_ssize_t groups = q->groups;
    const double *restrict row = q->row;
    const double *cost;
    double unit, mine;
    const double best = costs(q, nearest, &cost, &unit);
    const double far = best < INFINITY ? best + FAR / unit : -1.0, bits = unit * BITS_PER_NAT;
    v4 total = splat(0.0);
    Py_ssize_t g, v;
    choose(q, cost, row, 1, unit, best);
    for (g = 0; g < groups; g++) {
        if (q->transition == UNIFORM && row[g] > far) continue;
        for (v = g * nh; v < (g + 1) * nh; v++)
            total += share(splat(best), ((const v4 *)cost)[v], splat(far), splat(bits));
    }
    mine = (best - cost[q->label]) * unit;
    out->ll = q->ll_const - q->c * q->dist[q->label];
    out->probability = (mine == 0.0 ? 1.0 : exp(mine)) / ((total[0] + total[1]) + (total[2] + total[3]));
    if (!(out->probability >= 0.0)) out->probability = 0.0;
    /* a state that leaves more than about 2 rho does not explain the data, however far it leads */
    out->confident = count >= q->window && out->ll >= q->ll_floor && leads(q);
}

/* takes in what was measured: history, z and w of the sample */
INLINE int measure(Core *q, double t, double u, const double *force, const double *budget, double s) {
    if (q->timed) {
        if (grow(q)) return -1;
        q->t[q->k & (q->cap - 1)] = t;
        if (q->k == 0) q->start = t;
    }
    if (!isfinite(u)) u = q->k > 0 ? q->u[(q->k - 1) & (q->cap - 1)] : 0.0;
    q->u[q->k & (q->cap - 1)] = u;
    predict(q, force, budget, s);
    /* before the delay lines are full of measured u and Q has settled, a prediction rests on a guess: no label yet */
    if (!q->warm && q->k >= q->warmup_rows)
        q->warm = !q->timed || q->t[(q->k - q->aperture) & (q->cap - 1)] - q->start >= q->warmup_time;
    q->k++;
    return 0;
}

/* one sample; `matrix` (states) takes all log-likelihoods instead of a decision */
INLINE int advance(Core *q, double t, double u, double d, const double *force, const double *budget, double s,
                   const Py_ssize_t nh, const int wide, double *matrix, Result *out) {
    const int missing = !(isfinite(u) && isfinite(d));
    if (measure(q, t, u, force, budget, s)) return -1;
    out->ll = NAN; out->probability = NAN; out->confident = 0; out->status = WARMUP;
    if (q->warm) {
        const double nearest = window(q, q->w + q->sign * d, missing, nh, wide);
        if (!missing) {
            out->status = q->count >= q->window ? FULL : PARTIAL;
            if (matrix) {
                Py_ssize_t i;
                for (i = 0; i < q->states; i++) matrix[i] = q->ll_const - q->c * q->dist[lane(q, i)];
            } else {
                decide(q, q->count, nearest, nh, out);
            }
        }
    }
    out->state = q->state_of[q->label];
    return 0;
}

typedef struct {
    const double *t, *u, *d, *force, *budget, *sign;
    double *matrix, *ll, *probability;
    int32_t *state;
    uint8_t *confident;
    double *model;          /* y, and z per group, of every sample; y is NaN where nothing was judged */
} Arrays;

/* what was predicted of the sample that `advance` just took */
INLINE void put_model(const Core *q, const Arrays *x, Py_ssize_t i) {
    double *row = x->model + i * (q->groups + 1);
    row[0] = q->warm && isfinite(x->u[i]) ? q->w + q->sign * x->d[i] : NAN;
    memcpy(row + 1, q->z, sizeof(double) * q->groups);
}

INLINE void put(const Arrays *x, Py_ssize_t i, const Result *one) {
    x->state[i] = one->state;
    x->ll[i] = one->ll;
    x->probability[i] = one->probability;
    x->confident[i] = x->matrix ? one->status : one->confident;
}

/* `decide` of LANES samples one by one */
INLINE void decide_each(Core *q, v4 nearest, const Py_ssize_t nh, Py_ssize_t at, const Arrays *x) {
    const Py_ssize_t groups = q->groups, nv = groups * nh;
    Result out;
    Py_ssize_t g, v;
    int i;
    for (i = 0; i < LANES; i++) {
        for (v = 0; v < nv; v++) ((v4 *)q->dist)[v] = ((v4 *)q->dist4)[v * LANES + i];
        for (g = 0; g < groups; g++) q->row[g] = q->row4[g * LANES + i];
        decide(q, q->count - LANES + 1 + i, nearest[i], nh, &out);
        out.state = q->state_of[q->label];
        put(x, at + i, &out);
    }
}

/* The labels of LANES samples with a uniform A, as lanes, and how far each is from the best state, in `mine`. */
INLINE i4 label_tile(Core *q, v4 best, v4 *mine, const int wide) {
    const double *own = q->dist4 + place(q->label, LANES);
    const v4 unit = splat(q->c), tie = splat(1e-9) * (splat(1.0) + best * unit), hold = splat(q->hold);
    i4 label = (i4){q->label, q->label, q->label, q->label};
    int i;
    *mine = (v4){own[0], own[LANES], own[2 * LANES], own[3 * LANES]};
    if (!any((*mine - best) * unit > pick(hold > tie, hold, tie), wide)) return label;
    for (i = 0; i < LANES; i++) {
        choose(q, q->dist4 + i * LANES, q->row4 + i, LANES, q->c, best[i]);
        label[i] = q->label;
        (*mine)[i] = q->dist4[place(q->label, LANES) + i * LANES];
    }
    return label;
}

/* `decide` of LANES samples with a uniform A */
INLINE void decide_tile(Core *q, v4 best, const Py_ssize_t nh, Py_ssize_t at, const Arrays *x, const int wide) {
    v4 mine;
    const i4 label = label_tile(q, best, &mine, wide);
    const v4 *restrict dist = (v4 *)q->dist4, *restrict row = (v4 *)q->row4;
    const v4 unit = splat(q->c), bits = splat(q->c * BITS_PER_NAT), limit = mine + splat(q->lead);
    const v4 far = pick(best < splat(INFINITY), best + splat(FAR / q->c), splat(-1.0));
    const v4 reach = pick(far > limit, far, limit), lag = (mine - best) * unit, ll = splat(q->ll_const) - unit * mine;
    const v4 r0 = splat(reach[0]), r1 = splat(reach[1]), r2 = splat(reach[2]), r3 = splat(reach[3]);
    v4 total[LANES] = {splat(0.0), splat(0.0), splat(0.0), splat(0.0)}, probability = splat(1.0);
    i4 within = {0}, sure;      /* how many states are within `limit`, below 0 */
    Py_ssize_t g, h;
    int i;
    for (g = 0; g < q->groups; g++) {
        if (!any(row[g] <= reach, wide)) continue;
        for (h = 0; h < nh; h++) {
            const v4 *here = dist + (g * nh + h) * LANES;
            v4 d[LANES] = {here[0], here[1], here[2], here[3]};
            if (nh > 1 && !any((d[0] <= r0) | (d[1] <= r1) | (d[2] <= r2) | (d[3] <= r3), wide)) continue;
            turn(&d[0], &d[1], &d[2], &d[3]);       /* from a sample of four states to a state at four samples */
            for (i = 0; i < LANES; i++) {
                within += d[i] < limit;
                if (any(d[i] <= far, wide)) total[i] += share(best, d[i], far, bits);
            }
        }
    }
    sure = (within == (mine < limit)) & (ll >= splat(q->ll_floor));     /* none but the label itself */
    if (any(lag != splat(0.0), wide)) for (i = 0; i < LANES; i++) probability[i] = lag[i] == 0.0 ? 1.0 : exp(-lag[i]);
    probability /= (total[0] + total[1]) + (total[2] + total[3]);
    for (i = 0; i < LANES; i++) {
        x->state[at + i] = q->state_of[label[i]];
        x->ll[at + i] = ll[i];
        x->probability[at + i] = probability[i] >= 0.0 ? probability[i] : 0.0;
        x->confident[at + i] = sure[i] != 0 && q->count - LANES + 1 + i >= q->window;
    }
}

/* LANES samples from `at` on, none of them missing */
INLINE int advance_tile(Core *q, Py_ssize_t at, const Arrays *x, const Py_ssize_t nh, const int wide) {
    v4 w, y, best;
    Py_ssize_t g;
    int i;
    if (!q->timed && !x->force && q->aperture == 1 && q->combos == 1) {
        for (i = 0; i < LANES; i++) q->u[(q->k + i) & (q->cap - 1)] = x->u[at + i];
        predict_tile(q, &w);
    } else {
        for (i = 0; i < LANES; i++) {
            if (measure(q, x->t ? x->t[at + i] : 0.0, x->u[at + i], x->force ? x->force + (at + i) * q->combos : NULL,
                        x->budget ? x->budget + (at + i) * q->combos : NULL, x->sign ? x->sign[at + i] : 0.0))
                return -1;
            for (g = 0; g < q->groups; g++) q->z4[g * LANES + i] = q->z[g];
            w[i] = q->w;
        }
    }
    y = w + splat(q->sign) * (v4){x->d[at], x->d[at + 1], x->d[at + 2], x->d[at + 3]};
    for (i = 0; x->model && i < LANES; i++) {
        double *row = x->model + (at + i) * (q->groups + 1);
        row[0] = y[i];
        for (g = 0; g < q->groups; g++) row[1 + g] = q->z4[g * LANES + i];
    }
    best = window_tile(q, y, nh, wide);
    if (q->transition == UNIFORM) decide_tile(q, best, nh, at, x, wide);
    else decide_each(q, best, nh, at, x);
    return 0;
}

/* Whether the samples from `at` on fill a tile: past the warm-up, in one block of the window, all measured. */
INLINE int fills_tile(const Core *q, Py_ssize_t at, Py_ssize_t n, const Arrays *x) {
    double sum = 0.0;
    int i;
    if (!q->warm || x->matrix || at + LANES > n || q->slot + LANES > q->window) return 0;
    for (i = 0; i < LANES; i++) sum += x->u[at + i] * 0.0 + x->d[at + i] * 0.0;
    return sum == 0.0;      /* 0 times what is not finite is NaN */
}

INLINE int run_rows(Core *q, Py_ssize_t n, const Arrays *x, const Py_ssize_t nh, const int wide) {
    Result out;
    Py_ssize_t i = 0;
    while (i < n) {
        if (fills_tile(q, i, n, x)) {
            if (advance_tile(q, i, x, nh, wide)) return -1;
            i += LANES;
            continue;
        }
        if (advance(q, x->t ? x->t[i] : 0.0, x->u[i], x->d[i], x->force ? x->force + i * q->combos : NULL,
                    x->budget ? x->budget + i * q->combos : NULL, x->sign ? x->sign[i] : 0.0, nh, wide,
                    x->matrix ? x->matrix + i * q->states : NULL, &out))
            return -1;
        put(x, i, &out);
        if (x->model) put_model(q, x, i);
        i++;
    }
    return 0;
}

/* the usual widths of a group as constants, so that the inner loops unroll */
INLINE int run_wide(Core *q, Py_ssize_t n, const Arrays *x, const int wide) {
    if (q->width == LANES) return run_rows(q, n, x, 1, wide);
    if (q->width == 2 * LANES) return run_rows(q, n, x, 2, wide);
    if (q->width == 3 * LANES) return run_rows(q, n, x, 3, wide);
    return run_rows(q, n, x, q->width / LANES, wide);
}

INLINE int step_wide(Core *q, double u, double d, Result *out, const int wide) {
    const Py_ssize_t nh = q->width / LANES;
    if (nh == 1) return advance(q, 0.0, u, d, NULL, NULL, 0.0, 1, wide, NULL, out);
    return advance(q, 0.0, u, d, NULL, NULL, 0.0, nh, wide, NULL, out);
}

static int run_plain(Core *q, Py_ssize_t n, const Arrays *x) { return run_wide(q, n, x, 0); }
static int step_plain(Core *q, double u, double d, Result *out) { return step_wide(q, u, d, out, 0); }
#ifdef AVX2
AVX2 static int run_avx2(Core *q, Py_ssize_t n, const Arrays *x) { return run_wide(q, n, x, 1); }
AVX2 static int step_avx2(Core *q, double u, double d, Result *out) { return step_wide(q, u, d, out, 1); }
static int run_block(Core *q, Py_ssize_t n, const Arrays *x) {
    return __builtin_cpu_supports("avx2") ? run_avx2(q, n, x) : run_plain(q, n, x);
}
static int step_once(Core *q, double u, double d, Result *out) {
    return __builtin_cpu_supports("avx2") ? step_avx2(q, u, d, out) : step_plain(q, u, d, out);
}
#else
static int run_block(Core *q, Py_ssize_t n, const Arrays *x) { return run_plain(q, n, x); }
static int step_once(Core *q, double u, double d, Result *out) { return step_plain(q, u, d, out); }
#endif

/* ---- the Python type ----------------------------------------------------------------------------------------- */

typedef struct { PyObject_HEAD Core core; } Kernel;

static double *doubles(PyObject *source, Py_ssize_t expected) {
    Py_buffer view;
    double *copy;
    if (PyObject_GetBuffer(source, &view, PyBUF_C_CONTIGUOUS)) return NULL;
    if (view.len != expected * (Py_ssize_t)sizeof(double)) {
        PyBuffer_Release(&view);
        PyErr_SetString(PyExc_ValueError, "kernel: an array has the wrong length");
        return NULL;
    }
    copy = malloc(view.len ? view.len : 1);
    if (copy) memcpy(copy, view.buf, view.len);
    else PyErr_NoMemory();
    PyBuffer_Release(&view);
    return copy;
}

static void restart(Core *q) {
    q->k = q->count = q->slot = 0;
    q->warm = 0;
    q->w = q->u_mean = q->start = 0.0;
    q->interval = q->T;
    memset(q->pointer, 0, sizeof(int64_t) * q->delays);
    memset(q->z, 0, sizeof(double) * q->groups);
    memset(q->raw, 0, sizeof(double) * q->groups);
    clear_prefix(q);
    memset(q->ring, 0, sizeof(double) * q->padded * (q->window + 1));
}

/* The arrays of the inner loops, in one 32-byte aligned block. */
static int allocate(Core *q, const double *alpha, const double *axis, const double *log_a) {
    const Py_ssize_t n = q->padded, S = q->states, width = q->width;
    const Py_ssize_t rows = 3 + LANES + q->axes + (q->window + 1) + (log_a ? n : 0);
    Py_ssize_t a, s;
    double *next;
    q->state_of = calloc(n, sizeof(int32_t));
    q->block = calloc(rows * n + width + (1 + 2 * LANES) * q->groups + LANES, sizeof(double));
    if (!q->state_of || !q->block) return -1;
    next = (double *)(((uintptr_t)q->block + 31) & ~(uintptr_t)31);
    q->alpha = next; next += width;
    q->prefix = next; next += n;
    q->dist = next; next += n;
    q->dist4 = next; next += n * LANES;
    q->row4 = next; next += q->groups * LANES;
    q->z4 = next; next += q->groups * LANES;
    q->cost = next; next += n;
    q->axis = next; next += n * q->axes;
    q->ring = next; next += n * (q->window + 1);
    q->log_a = next; next += log_a ? n * n : 0;
    q->row = next;
    for (s = 0; s < q->inertias; s++) q->alpha[s] = alpha[s];
    for (s = 0; s < S; s++) {
        q->state_of[lane(q, s)] = (int32_t)s;
        for (a = 0; a < q->axes; a++) {
            q->axis[a * n + lane(q, s)] = axis[a * S + s];
        }
        for (a = 0; log_a && a < S; a++) q->log_a[lane(q, a) * n + lane(q, s)] = log_a[a * S + s];
    }
    return 0;
}

static int fill(Core *q, PyObject *delays, PyObject *alphas, PyObject *axes, PyObject *log_a) {
    double *alpha = NULL, *axis = NULL, *matrix = NULL;
    Py_ssize_t g, most = 0;
    int bad = -1;
    q->groups = q->delays * q->combos;
    q->states = q->groups * q->inertias;
    q->width = (q->inertias + LANES - 1) / LANES * LANES;
    q->padded = q->groups * q->width;
    q->label = lane(q, q->label);
    q->delay = doubles(delays, q->delays);
    alpha = q->delay ? doubles(alphas, q->inertias) : NULL;
    axis = alpha ? doubles(axes, q->axes * q->states) : NULL;
    if (axis && log_a != Py_None && !(matrix = doubles(log_a, q->states * q->states))) goto done;
    if (!axis) goto done;
    q->frac = calloc(q->delays, sizeof(double));
    q->whole = calloc(q->delays, sizeof(int64_t));
    q->pointer = calloc(q->delays, sizeof(int64_t));
    q->z = calloc(q->groups, sizeof(double));
    q->raw = calloc(q->groups, sizeof(double));
    if (!q->frac || !q->whole || !q->pointer || !q->z || !q->raw) { PyErr_NoMemory(); goto done; }
    for (g = 0; g < q->delays; g++) {
        const double ratio = q->delay[g] / q->T, nearest = floor(ratio + 0.5);
        /* 0.3 / 0.001 is 299.99999999999994: a whole number of samples is meant */
        const double exact = fabs(ratio - nearest) < 1e-9 * (1.0 + nearest) ? nearest : ratio;
        q->whole[g] = (int64_t)floor(exact);
        q->frac[g] = exact - floor(exact);
        if (q->whole[g] > most) most = q->whole[g];
    }
    for (q->cap = 64; q->cap < (q->timed ? 64 : most + LANES + 4); q->cap *= 2) {}
    q->u = calloc(q->cap, sizeof(double));
    q->t = calloc(q->cap, sizeof(double));
    if (!q->u || !q->t || allocate(q, alpha, axis, matrix)) { PyErr_NoMemory(); goto done; }
    q->c = 0.5 / (q->c * q->c);
    q->lead = q->confidence / q->c;
    q->pole = q->filtered && q->tau > 0.0 ? exp(-q->T / q->tau) : 0.0;
    restart(q);
    bad = 0;
done:
    free(alpha);
    free(axis);
    free(matrix);
    return bad;
}

static PyObject *kernel_new(PyTypeObject *type, PyObject *args, PyObject *kwargs) {
    PyObject *delays, *alphas, *axes, *log_a;
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    Kernel *self = (Kernel *)alloc(type, 0);
    Core *q;
    (void)kwargs;
    if (!self) return NULL;
    q = &self->core;
    if (!PyArg_ParseTuple(args, "OOOOnnnnnniiiidddddddddddn", &delays, &alphas, &axes, &log_a, &q->delays, &q->combos,
                          &q->inertias, &q->axes, &q->window, &q->warmup_rows, &q->timed, &q->filtered, &q->aperture,
                          &q->transition, &q->T, &q->tau, &q->warmup_time, &q->sign, &q->c, &q->ll_const, &q->ll_floor, &q->hold, &q->confidence,
                          &q->log_stay, &q->log_move, &q->label)
        || fill(q, delays, alphas, axes, log_a)) {
        Py_DECREF(self);
        return NULL;
    }
    return (PyObject *)self;
}

static void kernel_dealloc(PyObject *object) {
    Core *q = &((Kernel *)object)->core;
    PyTypeObject *type = Py_TYPE(object);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    free(q->delay); free(q->frac); free(q->state_of); free(q->whole); free(q->pointer);
    free(q->z); free(q->raw); free(q->u); free(q->t); free(q->block);
    release(object);
    Py_DECREF(type);
}

static PyObject *kernel_restart(PyObject *object, PyObject *unused) {
    (void)unused;
    restart(&((Kernel *)object)->core);
    Py_RETURN_NONE;
}

/* (state, ll, probability, confident); a format would be read anew at every step */
static PyObject *answer(const Result *out) {
    PyObject *parts[] = {PyLong_FromLong(out->state), PyFloat_FromDouble(out->ll), PyFloat_FromDouble(out->probability),
                         PyBool_FromLong(out->confident)};
    PyObject *all = PyTuple_New(4);
    Py_ssize_t i;
    for (i = 0; i < 4; i++) {
        if (!parts[i]) Py_CLEAR(all);
        if (all) PyTuple_SetItem(all, i, parts[i]);
        else Py_XDECREF(parts[i]);
    }
    return all;
}

static PyObject *kernel_step(PyObject *object, PyObject *const *args, Py_ssize_t n) {
    Core *q = &((Kernel *)object)->core;
    Result out;
    double u, d;
    if (n != 2 || q->timed) {
        PyErr_SetString(PyExc_TypeError, "kernel.step takes u and d_hat on a regular clock");
        return NULL;
    }
    u = PyFloat_AsDouble(args[0]);
    d = PyFloat_AsDouble(args[1]);
    if (PyErr_Occurred()) return NULL;
    if (step_once(q, u, d, &out)) return PyErr_NoMemory();
    return answer(&out);
}

/* run(u, d, t, force, budget, sign, matrix, state, ll, probability, confident, model): buffers or None, all C-contiguous */
static PyObject *kernel_run(PyObject *object, PyObject *const *args, Py_ssize_t n) {
    enum { U, D, T, FORCE, BUDGET, SGN, MATRIX_OUT, STATE, LL, PROBABILITY, CONFIDENT, MODEL,
           ALL };
    Core *q = &((Kernel *)object)->core;
    Py_buffer view[ALL];
    Py_ssize_t i, rows = 0, opened = 0;
    int bad = 0;
    if (n != ALL) {
        PyErr_SetString(PyExc_TypeError, "kernel.run takes 12 arguments");
        return NULL;
    }
    for (; opened < ALL; opened++) {
        memset(&view[opened], 0, sizeof(Py_buffer));
        if (args[opened] == Py_None) continue;
        if (PyObject_GetBuffer(args[opened], &view[opened],
                               opened >= MATRIX_OUT ? PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE : PyBUF_C_CONTIGUOUS)) break;
    }
    if (opened < ALL) goto done;
    rows = view[U].len / (Py_ssize_t)sizeof(double);
    {
        const Py_ssize_t want[ALL] = {8 * rows, 8 * rows, q->timed ? 8 * rows : 0, 8 * rows * q->combos,
                                      8 * rows * q->combos, 8 * rows, 8 * rows * q->states, 4 * rows, 8 * rows,
                                      8 * rows, rows, 8 * rows * (q->groups + 1)};
        for (i = 0; i < ALL; i++)
            if (view[i].buf ? view[i].len != want[i] : (i == U || i == D || (i >= STATE && i < MODEL) || (i == T && q->timed))) {
                PyErr_Format(PyExc_ValueError, "kernel.run: argument %zd has the wrong length", i);
                goto done;
            }
    }
    Py_BEGIN_ALLOW_THREADS
    {
        const Arrays x = {view[T].buf, view[U].buf, view[D].buf, view[FORCE].buf, view[BUDGET].buf, view[SGN].buf,
                          view[MATRIX_OUT].buf, view[LL].buf, view[PROBABILITY].buf, view[STATE].buf,
                          view[CONFIDENT].buf, view[MODEL].buf};
        bad = run_block(q, rows, &x);
    }
    Py_END_ALLOW_THREADS
    if (bad) PyErr_NoMemory();
done:
    for (i = 0; i < opened; i++) if (args[i] != Py_None) PyBuffer_Release(&view[i]);
    if (PyErr_Occurred()) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef kernel_methods[] = {
    {"step", (PyCFunction)(void (*)(void))kernel_step, METH_FASTCALL, "step(u, d_hat) -> (state, ll, probability, confident)"},
    {"run", (PyCFunction)(void (*)(void))kernel_run, METH_FASTCALL, "run(u, d, t, force, budget, sign, matrix, *out)"},
    {"restart", kernel_restart, METH_NOARGS, "forget history and window, keep the label"},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot kernel_slots[] = {
    {Py_tp_new, kernel_new},
    {Py_tp_dealloc, kernel_dealloc},
    {Py_tp_methods, kernel_methods},
    {0, NULL},
};

static PyType_Spec kernel_spec = {"dsd_cli.detect._kernel.Kernel", sizeof(Kernel), 0, Py_TPFLAGS_DEFAULT, kernel_slots};

static int module_exec(PyObject *module) {
    PyObject *type = PyType_FromSpec(&kernel_spec);
    int bad = !type || PyModule_AddObjectRef(module, "Kernel", type);
    Py_XDECREF(type);
    return bad ? -1 : 0;
}

static PyModuleDef_Slot module_slots[] = {{Py_mod_exec, module_exec}, {0, NULL}};

static struct PyModuleDef module_def = {
    PyModuleDef_HEAD_INIT, "_kernel",
    "The compiled detection kernel. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, NULL, module_slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernel(void) { return PyModuleDef_Init(&module_def); }
