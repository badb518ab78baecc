/* Does a confident label explain its window? The compiled twin of numpy_goodness.py, one sample at a time.
 *
 * Every sample is added to the sums of its block (a sixteenth of the window), in order, so that a stream, an array and
 * any chunking give the same bits. A verdict is of the last sixteen blocks, is formed when a confident label asks for it
 * and stands until the next block is whole or the label moves.
 *
 * CPython limited API and buffers only: no NumPy headers. Nothing is allocated after the constructor.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define BLOCKS 16           /* a power of two */
#define MOST_FORCES 3
/* as in numpy_goodness.py and trust.py */
#define CHANCE 3.0
#define ROUNDING 1e-9
#define CHANCE_GAIN 0.5     /* nats that one free value gains by chance */
#define EARNED (4 * BLOCKS)
#define REMEMBERED (16.0 * BLOCKS)
#define MOST_BAD 0.2

/* where the columns of a block begin; each of the second line has one number per group (delay and effect values) */
typedef struct { Py_ssize_t y, yy, z, zz, zy, zd, dd, dy, xx, xy, xz, xd, width; } Layout;

/* robust: -1 not asked yet; beyond, better, slack: excess of the residual and nats that it is asked with */
typedef struct { int64_t block; int32_t state; int stands, bad, robust; double beyond, better, slack; } Verdict;

typedef struct {
    /* fixed */
    Py_ssize_t groups, inertias, size, forces;
    int free_alpha, free_delay;
    double c, need;
    double *alpha;
    Layout at;
    /* carried */
    int started;
    Py_ssize_t in_block;
    int64_t blocks, confident_blocks;
    double bad, weight;             /* of the trust in the model */
    double *before, *sum, *past;    /* z of the sample before; this block; a ring of the last BLOCKS blocks */
    double *whole;                  /* sums over a window */
    double *had;                    /* zz and dd of them before the unknown forces were taken out */
    Verdict last;
} Core;

static double larger(double a, double b) { return a > b || a != a ? a : b; }

static Layout layout(Py_ssize_t groups, Py_ssize_t k) {
    Layout at;
    at.y = 0; at.yy = 1; at.z = 2;
    at.zz = at.z + groups; at.zy = at.zz + groups; at.zd = at.zy + groups; at.dd = at.zd + groups;
    at.dy = at.dd + groups; at.xx = at.dy + groups; at.xy = at.xx + k * k; at.xz = at.xy + k;
    at.xd = at.xz + k * groups;
    at.width = at.xd + k * groups;
    return at;
}

/* ---- sums ---------------------------------------------------------------------------------------------------- */

/* y and z (`row`) and what unknown forces would do to y (`x`), one sample; one whose y is NaN adds nothing */
static void add(Core *q, const double *row, const double *x) {
    const Py_ssize_t groups = q->groups, k = q->forces;
    const double y = row[0], *restrict all = row + 1;
    double *restrict before = q->before, *sum = q->sum;
    double *restrict z1 = sum + q->at.z, *restrict zz = sum + q->at.zz, *restrict zy = sum + q->at.zy;
    double *restrict zd = sum + q->at.zd, *restrict dd = sum + q->at.dd, *restrict dy = sum + q->at.dy;
    Py_ssize_t g, i, j;
    if (isfinite(y)) {
        sum[q->at.y] += y;
        sum[q->at.yy] += y * y;
        for (g = 0; g < groups; g++) {
            const double z = all[g], d = before[g] - z;
            z1[g] += z;
            zz[g] += z * z;
            zy[g] += z * y;
            zd[g] += z * d;
            dd[g] += d * d;
            dy[g] += d * y;
        }
        for (i = 0; i < k; i++) {
            for (j = 0; j < k; j++) sum[q->at.xx + i * k + j] += x[i] * x[j];
            sum[q->at.xy + i] += x[i] * y;
            for (g = 0; g < groups; g++) sum[q->at.xz + i * groups + g] += x[i] * all[g];
            for (g = 0; g < groups; g++) sum[q->at.xd + i * groups + g] += x[i] * (before[g] - all[g]);
        }
    }
    memcpy(before, all, sizeof(double) * groups);
    if (++q->in_block < q->size) return;
    memcpy(q->past + (q->blocks++ & (BLOCKS - 1)) * q->at.width, sum, sizeof(double) * q->at.width);
    memset(sum, 0, sizeof(double) * q->at.width);
    q->in_block = 0;
}

/* block i of the window, 0 the oldest */
static const double *block(const Core *q, Py_ssize_t i) {
    return q->past + ((q->blocks + i) & (BLOCKS - 1)) * q->at.width;
}

/* `whole` = sums over the window, in pairs of blocks, pairs of pairs and so on */
static void sum_up(Core *q) {
    const double *b[BLOCKS];
    Py_ssize_t i, j;
    for (i = 0; i < BLOCKS; i++) b[i] = block(q, i);
    for (j = 0; j < q->at.width; j++)
        q->whole[j] = (((b[0][j] + b[1][j]) + (b[2][j] + b[3][j])) + ((b[4][j] + b[5][j]) + (b[6][j] + b[7][j])))
                    + (((b[8][j] + b[9][j]) + (b[10][j] + b[11][j])) + ((b[12][j] + b[13][j]) + (b[14][j] + b[15][j])));
}

/* ---- verdicts ------------------------------------------------------------------------------------------------ */

/* nats by which `state` leads over every other; its residual sum of squares in `mine` */
static double lead(const Core *q, double yy, const double *zy, const double *zz, Py_ssize_t state, double *mine) {
    double best = INFINITY;
    Py_ssize_t g, i;
    int lost = 0;
    *mine = NAN;
    for (g = 0; g < q->groups; g++) {
        for (i = 0; i < q->inertias; i++) {
            const double a = q->alpha[i], square = yy - 2.0 * a * zy[g] + a * a * zz[g];
            lost |= square != square;
            if (g * q->inertias + i == state) *mine = square;
            else if (square < best) best = square;
        }
    }
    return lost ? NAN : (best - *mine) * q->c;
}

/* nats that the best inertia and delay near `state` would gain: the score test */
static double gain(const Core *q, Py_ssize_t group, double a) {
    const double *w = q->whole + group;
    const double zz = w[q->at.zz], zy = w[q->at.zy], zd = w[q->at.zd], dd = w[q->at.dd], dy = w[q->at.dy];
    const double along = q->free_alpha ? zy - a * zz : 0.0, across = q->free_delay ? dy - a * zd : 0.0;
    const double of_alpha = zz > 0.0 ? along * along / zz : 0.0, of_delay = dd > 0.0 ? across * across / dd : 0.0;
    const double det = zz * dd - zd * zd;
    if (!q->free_alpha || !q->free_delay) return (of_alpha + of_delay) * q->c;
    if (!(det > ROUNDING * zz * dd)) return of_alpha * q->c;
    return (dd * (along * along) - 2.0 * zd * along * across + zz * (across * across)) / det * q->c;
}

/* whether no other group explains the window better than that of `group`, each with its best inertia */
static int nearest(const Core *q, Py_ssize_t group, double slack) {
    const double *zz = q->whole + q->at.zz, *zy = q->whole + q->at.zy;
    double own = 0.0, others = 0.0;     /* what of yy each explains */
    Py_ssize_t g;
    if (!q->free_alpha) return 1;
    for (g = 0; g < q->groups; g++) {
        const double share = zz[g] > 0.0 && zy[g] > 0.0 ? zy[g] * zy[g] / zz[g] : 0.0;
        if (g == group) own = share;
        else others = larger(others, share);
    }
    return (others - own) * q->c <= CHANCE_GAIN + slack;
}

/* a mean square of n values, in units of its expectation, less what chance may add */
static double over_chance(double ratio, double n) { return ratio / (1.0 + CHANCE / sqrt(n)); }

/* variance of the residual's sums over that of white noise of rho, on the worst time scale; 1 or more */
static double excess(const Core *q, Py_ssize_t group, double a, double mine) {
    const double samples = (double)(q->size * BLOCKS);
    double worst = larger(1.0, over_chance(mine * 2.0 * q->c / samples, samples));
    int scale, i, j;
    for (scale = 1; scale <= 4; scale *= 2) {
        const int n = BLOCKS / scale;
        double squares = 0.0;
        for (i = 0; i < n; i++) {
            double residual = 0.0;
            for (j = 0; j < scale; j++) {
                const double *b = block(q, i * scale + j);
                residual += b[q->at.y] - a * b[q->at.z + group];
            }
            squares += residual * residual;
        }
        worst = larger(worst, over_chance(squares / n / (double)(scale * q->size) * 2.0 * q->c, n));
    }
    return worst;
}

/* takes out of the window's products of y, z and d whatever a combination of the unknown forces explains, one force
 * after another; what rounding leaves of z or d is nothing */
static void take_forces_out(Core *q) {
    const Py_ssize_t k = q->forces, groups = q->groups;
    double *w = q->whole, *xx = w + q->at.xx, *xy = w + q->at.xy, first[MOST_FORCES];
    double *zz = w + q->at.zz, *zy = w + q->at.zy, *zd = w + q->at.zd, *dd = w + q->at.dd, *dy = w + q->at.dy;
    Py_ssize_t i, j, l, g;
    memcpy(q->had, zz, sizeof(double) * groups);
    memcpy(q->had + groups, dd, sizeof(double) * groups);
    for (i = 0; i < k; i++) first[i] = xx[i * k + i];
    for (i = 0; i < k; i++) {
        const double pivot = xx[i * k + i], *xz = w + q->at.xz + i * groups, *xd = w + q->at.xd + i * groups;
        if (!(pivot > ROUNDING * first[i])) continue;       /* a sum of the forces before it */
        w[q->at.yy] -= xy[i] * xy[i] / pivot;
        for (g = 0; g < groups; g++) {
            zy[g] -= xz[g] * xy[i] / pivot;
            zz[g] -= xz[g] * xz[g] / pivot;
            zd[g] -= xz[g] * xd[g] / pivot;
            dd[g] -= xd[g] * xd[g] / pivot;
            dy[g] -= xd[g] * xy[i] / pivot;
        }
        for (j = i + 1; j < k; j++) {
            const double share = xx[i * k + j] / pivot;
            for (l = i + 1; l < k; l++) xx[j * k + l] -= share * xx[i * k + l];
            xy[j] -= share * xy[i];
            for (g = 0; g < groups; g++) w[q->at.xz + j * groups + g] -= share * xz[g];
            for (g = 0; g < groups; g++) w[q->at.xd + j * groups + g] -= share * xd[g];
        }
    }
    w[q->at.yy] = larger(w[q->at.yy], 0.0);
    for (g = 0; g < groups; g++) {
        if (!(zz[g] > ROUNDING * q->had[g])) zz[g] = zy[g] = zd[g] = 0.0;
        if (!(dd[g] > ROUNDING * q->had[groups + g])) dd[g] = dy[g] = zd[g] = 0.0;
    }
}

static double slack_of(const Core *q) { return 1e-15 * (double)(q->size * BLOCKS + 10) * q->whole[q->at.yy] * q->c; }

static Verdict judged(Core *q, int32_t state) {
    const Py_ssize_t group = state / q->inertias;
    const double a = q->alpha[state % q->inertias];
    Verdict out = {q->blocks, state, 0, 0, 0, 1.0, 0.0, 0.0};
    double ahead, mine;
    if (q->blocks < BLOCKS) return out;
    sum_up(q);
    out.slack = slack_of(q);
    ahead = lead(q, q->whole[q->at.yy], q->whole + q->at.zy, q->whole + q->at.zz, state, &mine);
    out.better = larger(gain(q, group, a) - out.slack, 0.0);
    out.beyond = excess(q, group, a, larger(mine - out.slack / q->c, 0.0));
    out.stands = ahead >= q->need * out.beyond + out.better - out.slack && nearest(q, group, out.slack);
    out.bad = out.beyond > 1.0;
    out.robust = -1;
    return out;
}

/* whether the label stands beside unknown forces, too */
static int robust(Core *q, const Verdict *asked) {
    const Py_ssize_t group = asked->state / q->inertias;
    double ahead, mine, better;
    sum_up(q);
    take_forces_out(q);
    ahead = lead(q, q->whole[q->at.yy], q->whole + q->at.zy, q->whole + q->at.zz, asked->state, &mine);
    better = larger(asked->better, gain(q, group, q->alpha[asked->state % q->inertias]) - asked->slack);
    return ahead >= q->need * asked->beyond + better - asked->slack && nearest(q, group, asked->slack);
}

/* see trust.py */
static int trusted(const Core *q) { return q->confident_blocks >= EARNED && q->bad <= MOST_BAD * q->weight; }

static void follow(Core *q, int bad) {
    const double keep = 1.0 - 1.0 / REMEMBERED;
    q->bad = keep * q->bad + (1.0 - keep) * (bad ? 1.0 : 0.0);
    q->weight = keep * q->weight + (1.0 - keep);
    q->confident_blocks++;
}

/* whether the confident label of the sample that was just added does not stand */
static int unfounded(Core *q, int32_t state) {
    if (q->last.block != q->blocks || q->last.state != state) q->last = judged(q, state);
    if (!q->forces) return !q->last.stands;
    if (q->in_block == 0) follow(q, q->last.bad);
    if (!q->last.stands) return 1;
    if (trusted(q)) return 0;
    if (q->last.robust < 0) q->last.robust = robust(q, &q->last);
    return !q->last.robust;
}

static void run(Core *q, Py_ssize_t n, const double *model, const int32_t *state, const uint8_t *confident,
                const double *x, uint8_t *wrong) {
    Py_ssize_t i;
    for (i = 0; i < n; i++, model += 1 + q->groups) {
        wrong[i] = 0;
        q->started |= isfinite(model[0]) != 0;
        if (!q->started) continue;
        add(q, model, x ? x + i * q->forces : NULL);
        if (confident[i]) wrong[i] = (uint8_t)unfounded(q, state[i]);
    }
}

/* ---- the Python type ----------------------------------------------------------------------------------------- */

typedef struct { PyObject_HEAD Core core; } Goodness;

static void restart(Core *q) {
    q->started = 0;
    q->in_block = 0;
    q->blocks = q->confident_blocks = 0;
    q->bad = q->weight = 0.0;
    q->last.block = -1;
    memset(q->before, 0, sizeof(double) * q->groups);
    memset(q->sum, 0, sizeof(double) * q->at.width);
}

static int fill(Core *q, PyObject *alphas) {
    Py_buffer view;
    if (q->groups < 1 || q->size < 1 || q->forces < 0 || q->forces > MOST_FORCES) {
        PyErr_SetString(PyExc_ValueError, "goodness: groups, block size or forces out of range");
        return -1;
    }
    if (PyObject_GetBuffer(alphas, &view, PyBUF_C_CONTIGUOUS)) return -1;
    q->inertias = view.len / (Py_ssize_t)sizeof(double);
    q->at = layout(q->groups, q->forces);
    q->alpha = malloc(view.len ? view.len : 1);
    q->before = malloc(sizeof(double) * q->groups);
    q->sum = malloc(sizeof(double) * q->at.width);
    q->whole = malloc(sizeof(double) * q->at.width);
    q->had = malloc(sizeof(double) * 2 * q->groups);
    q->past = calloc(BLOCKS * q->at.width, sizeof(double));
    if (q->alpha) memcpy(q->alpha, view.buf, view.len);
    PyBuffer_Release(&view);
    if (!q->alpha || !q->before || !q->sum || !q->whole || !q->had || !q->past) { PyErr_NoMemory(); return -1; }
    if (q->inertias < 1) { PyErr_SetString(PyExc_ValueError, "goodness: no inertia"); return -1; }
    restart(q);
    return 0;
}

static PyObject *goodness_new(PyTypeObject *type, PyObject *args, PyObject *kwargs) {
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    Goodness *self = (Goodness *)alloc(type, 0);
    PyObject *alphas;
    Core *q;
    (void)kwargs;
    if (!self) return NULL;
    q = &self->core;
    if (!PyArg_ParseTuple(args, "Onnnddpp", &alphas, &q->groups, &q->size, &q->forces, &q->c, &q->need, &q->free_alpha,
                          &q->free_delay)
        || fill(q, alphas)) {
        Py_DECREF(self);
        return NULL;
    }
    return (PyObject *)self;
}

static void goodness_dealloc(PyObject *object) {
    Core *q = &((Goodness *)object)->core;
    PyTypeObject *type = Py_TYPE(object);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    free(q->alpha); free(q->before); free(q->sum); free(q->whole); free(q->had); free(q->past);
    release(object);
    Py_DECREF(type);
}

static PyObject *goodness_restart(PyObject *object, PyObject *unused) {
    (void)unused;
    restart(&((Goodness *)object)->core);
    Py_RETURN_NONE;
}

/* run(model, state, confident, forces, wrong): C-contiguous buffers, forces None where none are unknown */
static PyObject *goodness_run(PyObject *object, PyObject *const *args, Py_ssize_t n) {
    enum { MODEL, STATE, CONFIDENT, FORCES, WRONG, ALL };
    Core *q = &((Goodness *)object)->core;
    Py_buffer view[ALL];
    Py_ssize_t i, rows, opened = 0;
    if (n != ALL) {
        PyErr_SetString(PyExc_TypeError, "goodness.run takes 5 arguments");
        return NULL;
    }
    for (; opened < ALL; opened++) {
        memset(&view[opened], 0, sizeof(Py_buffer));
        if (args[opened] == Py_None) continue;
        if (PyObject_GetBuffer(args[opened], &view[opened],
                               opened == WRONG ? PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE : PyBUF_C_CONTIGUOUS)) goto done;
    }
    rows = view[WRONG].len;
    {
        const Py_ssize_t want[ALL] = {8 * rows * (q->groups + 1), 4 * rows, rows, 8 * rows * q->forces, rows};
        const int32_t *state = view[STATE].buf;
        for (i = 0; i < ALL; i++)
            if (view[i].len != want[i]) {
                PyErr_Format(PyExc_ValueError, "goodness.run: argument %zd has the wrong length", i);
                goto done;
            }
        for (i = 0; i < rows; i++)
            if (state[i] < 0 || state[i] >= q->groups * q->inertias) {
                PyErr_SetString(PyExc_ValueError, "goodness.run: no such state");
                goto done;
            }
    }
    Py_BEGIN_ALLOW_THREADS
    run(q, rows, view[MODEL].buf, view[STATE].buf, view[CONFIDENT].buf, view[FORCES].buf, view[WRONG].buf);
    Py_END_ALLOW_THREADS
done:
    for (i = 0; i < opened; i++) if (args[i] != Py_None) PyBuffer_Release(&view[i]);
    if (PyErr_Occurred()) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef goodness_methods[] = {
    {"run", (PyCFunction)(void (*)(void))goodness_run, METH_FASTCALL, "run(model, state, confident, forces, wrong)"},
    {"restart", goodness_restart, METH_NOARGS, "forget the window"},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot goodness_slots[] = {
    {Py_tp_new, goodness_new},
    {Py_tp_dealloc, goodness_dealloc},
    {Py_tp_methods, goodness_methods},
    {0, NULL},
};

static PyType_Spec goodness_spec = {"dsd_cli.detect._goodness.Goodness", sizeof(Goodness), 0, Py_TPFLAGS_DEFAULT,
                                    goodness_slots};

static int module_exec(PyObject *module) {
    PyObject *type = PyType_FromSpec(&goodness_spec);
    int bad = !type || PyModule_AddObjectRef(module, "Goodness", type);
    Py_XDECREF(type);
    return bad ? -1 : 0;
}

static PyModuleDef_Slot module_slots[] = {{Py_mod_exec, module_exec}, {0, NULL}};

static struct PyModuleDef module_def = {
    PyModuleDef_HEAD_INIT, "_goodness",
    "What a confident label must explain. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, NULL, module_slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__goodness(void) { return PyModuleDef_Init(&module_def); }
