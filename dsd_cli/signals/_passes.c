/* Passes over samples of which an identification makes thousands: each reads its samples once.
 *
 *   passed        y_i = sum taps_k x_(i step + k - before); beyond its ends x stays as it is there
 *   sine_cosine   sine and cosine of angles
 *   products      inner products of columns, by segment
 *   mixed         sums of columns times weights, by segment
 *
 * passes.py holds the readable twins; sums differ from them by rounding. x86 processors with AVX2 take a second copy of
 * the loops. CPython limited API and buffers of doubles only: no NumPy headers.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define AVX2 __attribute__((target("avx2,fma")))
#endif

typedef double v4 __attribute__((vector_size(32), aligned(8), may_alias));

/* values that are made at once: in registers, and from samples that stay at hand */
#define TOGETHER 16
#define BLOCK 2048

/* out_i += sum taps_k x_(i + k), for `count` values, a multiple of TOGETHER; what is read behind x is there */
INLINE void add_products(const double *x, const double *taps, Py_ssize_t many, double *out, Py_ssize_t count) {
    Py_ssize_t i, k;
    for (i = 0; i < count; i += TOGETHER) {
        v4 *to = (v4 *)(out + i), a = to[0], b = to[1], c = to[2], d = to[3];
        for (k = 0; k < many; k++) {
            const v4 *from = (const v4 *)(x + i + k), tap = {taps[k], taps[k], taps[k], taps[k]};
            a += tap * from[0];
            b += tap * from[1];
            c += tap * from[2];
            d += tap * from[3];
        }
        to[0] = a, to[1] = b, to[2] = c, to[3] = d;
    }
}

INLINE Py_ssize_t within(Py_ssize_t at, Py_ssize_t rows) { return at < 0 ? 0 : at < rows ? at : rows - 1; }

/* the samples of a block apart, by their place within a step: taps that meet them in turn then meet neighbours */
INLINE void filter(const double *x, Py_ssize_t rows, const double *taps, Py_ssize_t many, Py_ssize_t before,
                   Py_ssize_t step, double *out, Py_ssize_t count, double *room, Py_ssize_t block, Py_ssize_t width) {
    const Py_ssize_t each = (many + step - 1) / step;
    double *own = room + width, *sums = own + each;
    Py_ssize_t i, j, k, n;
    for (i = 0; i < count; i += block) {
        const Py_ssize_t some = count - i < block ? count - i : block;
        memset(sums, 0, (size_t)block * sizeof(double));
        for (j = 0; j < step && j < many; j++) {
            const Py_ssize_t first = i * step + j - before, need = some + each;
            const double *from = room;
            if (step == 1 && first >= 0 && first + width <= rows) from = x + first;
            else if (first >= 0 && first + (need - 1) * step < rows)
                for (k = 0; k < need; k++) room[k] = x[first + k * step];
            else
                for (k = 0; k < need; k++) room[k] = x[within(first + k * step, rows)];
            for (n = 0, k = j; k < many; k += step) own[n++] = taps[k];
            add_products(from, own, n, sums, (some + TOGETHER - 1) / TOGETHER * TOGETHER);
        }
        memcpy(out + i, sums, (size_t)some * sizeof(double));
    }
}

/* quarter turns are taken off in two parts, the first of which has room for 2^20 of them (fdlibm's numbers) */
#define QUARTERS 0.63661977236758134308
#define QUARTER 1.57079632673412561417
#define QUARTER_LOW 6.07710050650619224932e-11
#define ROUND 6755399441055744.0 /* 3 * 2^51: what is added to it is rounded to whole numbers */
#define MOST_ANGLE 1e6

INLINE void turn(const double *x, double *sine, double *cosine, Py_ssize_t rows) {
    Py_ssize_t i;
    for (i = 0; i < rows; i++) {
        const double shifted = x[i] * QUARTERS + ROUND, turns = shifted - ROUND;
        const double r = (x[i] - turns * QUARTER) - turns * QUARTER_LOW, z = r * r;
        const double s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 +
                         z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 +
                         z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
        const double c = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 +
                         z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 +
                         z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
        int64_t quarter;
        double first, second;
        memcpy(&quarter, &shifted, sizeof quarter);
        first = quarter & 1 ? c : s, second = quarter & 1 ? s : c;
        sine[i] = quarter & 2 ? -first : first;
        cosine[i] = (quarter + 1) & 2 ? -second : second;
    }
}

/* columns whose products with others are made at once, and of those; rows that stay at hand meanwhile */
#define OWN 2
#define OTHERS 4
#define AT_HAND 512

INLINE double all_of(v4 x) { return (x[0] + x[2]) + (x[1] + x[3]); }

/* sum_k += own_i x other_j over rows, k = OTHERS i + j */
INLINE void tile(const double **own, const double **other, Py_ssize_t rows, double *sum) {
    v4 s[OWN * OTHERS] = {{0}};
    Py_ssize_t n, i, j;
    for (n = 0; n + 4 <= rows; n += 4) {
        const v4 a = *(const v4 *)(own[0] + n), b = *(const v4 *)(own[1] + n);
        for (j = 0; j < OTHERS; j++) {
            const v4 x = *(const v4 *)(other[j] + n);
            s[j] += a * x;
            s[OTHERS + j] += b * x;
        }
    }
    for (i = 0; i < OWN; i++)
        for (j = 0; j < OTHERS; j++) {
            double rest = all_of(s[OTHERS * i + j]);
            Py_ssize_t m;
            for (m = n; m < rows; m++) rest += own[i][m] * other[j][m];
            sum[OTHERS * i + j] += rest;
        }
}

/* out (columns x columns) += the products of rows a to b; half of it, the others are the same */
INLINE void multiply(const double **x, Py_ssize_t columns, Py_ssize_t a, Py_ssize_t b, double *out) {
    Py_ssize_t i, j, m, n;
    for (; a < b; a += AT_HAND) {
        const Py_ssize_t rows = b - a < AT_HAND ? b - a : AT_HAND;
        for (i = 0; i < columns; i += OWN)
            for (j = i; j < columns; j += OTHERS) {
                const double *own[OWN], *other[OTHERS];
                double sum[OWN * OTHERS] = {0};
                for (m = 0; m < OWN; m++) own[m] = x[i + m < columns ? i + m : i] + a;
                for (n = 0; n < OTHERS; n++) other[n] = x[j + n < columns ? j + n : j] + a;
                tile(own, other, rows, sum);
                for (m = 0; m < OWN && i + m < columns; m++)
                    for (n = 0; n < OTHERS && j + n < columns; n++)
                        out[(i + m) * columns + j + n] += sum[OTHERS * m + n];
            }
    }
}

#define FILTER_ARGUMENTS const double *x, Py_ssize_t rows, const double *taps, Py_ssize_t many, Py_ssize_t before, \
                         Py_ssize_t step, double *out, Py_ssize_t count, double *room, Py_ssize_t block, Py_ssize_t width
static void filter_plain(FILTER_ARGUMENTS) { filter(x, rows, taps, many, before, step, out, count, room, block, width); }
static void turn_plain(const double *x, double *sine, double *cosine, Py_ssize_t rows) { turn(x, sine, cosine, rows); }
static void multiply_plain(const double **x, Py_ssize_t columns, Py_ssize_t a, Py_ssize_t b, double *out) {
    multiply(x, columns, a, b, out);
}
#ifdef AVX2
AVX2 static void filter_avx2(FILTER_ARGUMENTS) {
    filter(x, rows, taps, many, before, step, out, count, room, block, width);
}
AVX2 static void turn_avx2(const double *x, double *sine, double *cosine, Py_ssize_t rows) {
    turn(x, sine, cosine, rows);
}
AVX2 static void multiply_avx2(const double **x, Py_ssize_t columns, Py_ssize_t a, Py_ssize_t b, double *out) {
    multiply(x, columns, a, b, out);
}
static int wide(void) { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
#define filter_avx2 filter_plain
#define turn_avx2 turn_plain
#define multiply_avx2 multiply_plain
static int wide(void) { return 0; }
#endif

/* three columns of doubles, the last `written` of them to be written */
static int open_three(PyObject **objects, Py_buffer *view, int written) {
    int i;
    for (i = 0; i < 3; i++) {
        const int flags = i >= 3 - written ? PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE : PyBUF_C_CONTIGUOUS;
        if (PyObject_GetBuffer(objects[i], &view[i], flags)) break;
        if (view[i].len % (Py_ssize_t)sizeof(double)) {
            PyErr_SetString(PyExc_ValueError, "passes: columns of doubles are needed");
            i++;
            break;
        }
    }
    if (i == 3 && !PyErr_Occurred()) return 0;
    while (i > 0) PyBuffer_Release(&view[--i]);
    return -1;
}

static void close_three(Py_buffer *view) {
    int i;
    for (i = 0; i < 3; i++) PyBuffer_Release(&view[i]);
}

static PyObject *passed(PyObject *module, PyObject *args) {
    PyObject *objects[3];
    Py_buffer view[3];
    Py_ssize_t before, step, rows, many, count, block, width;
    double *room;
    (void)module;
    if (!PyArg_ParseTuple(args, "OOnnO", &objects[0], &objects[1], &before, &step, &objects[2])) return NULL;
    if (open_three(objects, view, 1)) return NULL;
    rows = view[0].len / (Py_ssize_t)sizeof(double), many = view[1].len / (Py_ssize_t)sizeof(double);
    count = view[2].len / (Py_ssize_t)sizeof(double);
    if (rows < 1 || many < 1 || before < 0 || step < 1) {
        close_three(view);
        PyErr_SetString(PyExc_ValueError, "passes: samples, taps and a step of at least 1 are needed");
        return NULL;
    }
    block = (BLOCK / step / TOGETHER + 1) * TOGETHER;
    width = block + (many + step - 1) / step + TOGETHER;
    room = calloc((size_t)(width + (many + step - 1) / step + block), sizeof(double));
    if (room == NULL) {
        close_three(view);
        return PyErr_NoMemory();
    }
    (wide() ? filter_avx2 : filter_plain)(view[0].buf, rows, view[1].buf, many, before, step, view[2].buf, count, room,
                                          block, width);
    free(room);
    close_three(view);
    Py_RETURN_NONE;
}

static PyObject *sine_cosine(PyObject *module, PyObject *args) {
    PyObject *objects[3];
    Py_buffer view[3];
    Py_ssize_t i, rows;
    int far = 0;
    (void)module;
    if (!PyArg_ParseTuple(args, "OOO", &objects[0], &objects[1], &objects[2])) return NULL;
    if (open_three(objects, view, 2)) return NULL;
    if (view[1].len != view[0].len || view[2].len != view[0].len) {
        close_three(view);
        PyErr_SetString(PyExc_ValueError, "passes: columns of one length are needed");
        return NULL;
    }
    {
        const double *x = view[0].buf;
        double *sine = view[1].buf, *cosine = view[2].buf;
        rows = view[0].len / (Py_ssize_t)sizeof(double);
        for (i = 0; i < rows; i++) far |= !(fabs(x[i]) <= MOST_ANGLE);
        if (far)
            for (i = 0; i < rows; i++) sine[i] = sin(x[i]), cosine[i] = cos(x[i]);
        else
            (wide() ? turn_avx2 : turn_plain)(x, sine, cosine, rows);
    }
    close_three(view);
    Py_RETURN_NONE;
}

/* columns of doubles in a tuple, all of one length, beside where segments of them begin and the last ends, int64 */
typedef struct {
    Py_buffer *view, edges, numbers, out;
    const double **x;
    Py_ssize_t columns, opened, rows, segments;
} Table;

static void close_table(Table *t) {
    while (t->opened > 0) PyBuffer_Release(&t->view[--t->opened]);
    if (t->edges.obj != NULL) PyBuffer_Release(&t->edges);
    if (t->numbers.obj != NULL) PyBuffer_Release(&t->numbers);
    if (t->out.obj != NULL) PyBuffer_Release(&t->out);
    free(t->view);
    free((void *)t->x);
}

static int open_table(Table *t, PyObject *tuple, PyObject *edges, PyObject *numbers, PyObject *out) {
    const int64_t *at;
    Py_ssize_t k;
    memset(t, 0, sizeof *t);
    t->columns = PyTuple_Size(tuple);
    t->view = calloc((size_t)t->columns + 1, sizeof *t->view), t->x = calloc((size_t)t->columns + 1, sizeof *t->x);
    if (t->view == NULL || t->x == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    for (; t->opened < t->columns; t->opened++) {
        if (PyObject_GetBuffer(PyTuple_GetItem(tuple, t->opened), &t->view[t->opened], PyBUF_C_CONTIGUOUS)) return -1;
        t->x[t->opened] = t->view[t->opened].buf;
    }
    if (PyObject_GetBuffer(edges, &t->edges, PyBUF_C_CONTIGUOUS)) return -1;
    if (numbers != NULL && PyObject_GetBuffer(numbers, &t->numbers, PyBUF_C_CONTIGUOUS)) return -1;
    if (PyObject_GetBuffer(out, &t->out, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE)) return -1;
    t->rows = t->columns > 0 ? t->view[0].len / (Py_ssize_t)sizeof(double) : -1;
    t->segments = t->edges.len / (Py_ssize_t)sizeof(int64_t) - 1, at = t->edges.buf;
    for (k = 1; k < t->columns; k++)
        if (t->view[k].len != t->view[0].len) t->rows = -1;
    for (k = 0; k < t->segments && t->rows >= 0; k++)
        if (at[k] < 0 || at[k + 1] < at[k] || at[k + 1] > t->rows) t->rows = -1;
    return t->rows < 0 || t->segments < 0 ? 1 : 0;
}

static PyObject *closed(Table *t, int wrong) {
    close_table(t);
    if (wrong > 0) PyErr_SetString(PyExc_ValueError, "passes: columns of one length, and segments of it, are needed");
    if (wrong) return NULL;
    Py_RETURN_NONE;
}

static PyObject *products(PyObject *module, PyObject *args) {
    PyObject *tuple, *objects[2];
    Table t;
    Py_ssize_t k, i, j;
    int wrong;
    (void)module;
    if (!PyArg_ParseTuple(args, "O!OO", &PyTuple_Type, &tuple, &objects[0], &objects[1])) return NULL;
    wrong = open_table(&t, tuple, objects[0], NULL, objects[1]);
    if (!wrong) wrong = t.out.len != t.segments * t.columns * t.columns * (Py_ssize_t)sizeof(double);
    for (k = 0; !wrong && k < t.segments; k++) {
        const int64_t *at = t.edges.buf;
        double *own = (double *)t.out.buf + k * t.columns * t.columns;
        (wide() ? multiply_avx2 : multiply_plain)(t.x, t.columns, at[k], at[k + 1], own);
        for (i = 0; i < t.columns; i++)
            for (j = i + 1; j < t.columns; j++) own[j * t.columns + i] = own[i * t.columns + j];
    }
    return closed(&t, wrong);
}

static PyObject *mixed(PyObject *module, PyObject *args) {
    PyObject *tuple, *objects[3];
    Table t;
    Py_ssize_t k, i, n, m;
    int wrong;
    (void)module;
    if (!PyArg_ParseTuple(args, "O!OOO", &PyTuple_Type, &tuple, &objects[0], &objects[1], &objects[2])) return NULL;
    wrong = open_table(&t, tuple, objects[0], objects[1], objects[2]);
    if (!wrong) wrong = t.numbers.len != t.segments * t.columns * (Py_ssize_t)sizeof(double) || t.out.len != t.view[0].len;
    for (k = 0; !wrong && k < t.segments; k++) {
        const int64_t *at = t.edges.buf;
        const double *weights = (const double *)t.numbers.buf + k * t.columns;
        for (n = at[k]; n < at[k + 1]; n += AT_HAND) {
            const Py_ssize_t rows = at[k + 1] - n < AT_HAND ? at[k + 1] - n : AT_HAND;
            double *out = (double *)t.out.buf + n;
            for (i = 0; i < t.columns; i++)
                for (m = 0; m < rows; m++) out[m] += weights[i] * t.x[i][n + m];
        }
    }
    return closed(&t, wrong);
}

static PyMethodDef methods[] = {
    {"passed", passed, METH_VARARGS, "passed(x, taps, before, step, out)"},
    {"sine_cosine", sine_cosine, METH_VARARGS, "sine_cosine(x, sine, cosine)"},
    {"products", products, METH_VARARGS, "products(columns, edges, out): out is 0 before"},
    {"mixed", mixed, METH_VARARGS, "mixed(columns, edges, weights, out): out is 0 before"},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_passes",
    "Compiled passes over samples. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__passes(void) { return PyModuleDef_Init(&definition); }
