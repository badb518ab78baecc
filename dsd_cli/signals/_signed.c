/* Least squares out of Gram matrices with coefficients that have a sign: signed.py is the readable twin, which differs
 * by rounding. CPython limited API and buffers of doubles only: no NumPy headers.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const double *stack, *signs;
    double *found, ridge, rounding;
    Py_ssize_t many, size, target;          /* matrices; rows of each: the target and `size - 1` columns */
    double *scale, *length, *a, *theta;     /* of the columns; a system in what is free, and its solution */
    Py_ssize_t *column, *free, frees;       /* row of each column; columns that are free, in this order */
    char *returned;
} Task;

/* Gauss with the largest pivot of each column; 0 where there is none */
static int eliminated(double *a, double *b, Py_ssize_t n) {
    Py_ssize_t i, j, k;
    for (k = 0; k < n; k++) {
        Py_ssize_t pivot = k;
        for (i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k])) pivot = i;
        if (a[pivot * n + k] == 0.0) return 0;
        if (pivot != k) {
            double kept = b[k];
            b[k] = b[pivot], b[pivot] = kept;
            for (j = k; j < n; j++) kept = a[k * n + j], a[k * n + j] = a[pivot * n + j], a[pivot * n + j] = kept;
        }
        for (i = k + 1; i < n; i++) {
            const double factor = a[i * n + k] / a[k * n + k];
            for (j = k + 1; j < n; j++) a[i * n + j] -= factor * a[k * n + j];
            b[i] -= factor * b[k];
        }
    }
    for (k = n - 1; k >= 0; k--) {
        for (j = k + 1; j < n; j++) b[k] -= a[k * n + j] * b[j];
        b[k] /= a[k * n + k];
    }
    return 1;
}

/* coefficients of what is free, of matrix m, into theta */
static int fitted(Task *t, Py_ssize_t m) {
    const double *gram = t->stack + m * t->size * t->size;
    const Py_ssize_t n = t->frees;
    Py_ssize_t i, j;
    for (i = 0; i < n; i++) {
        const Py_ssize_t own = t->free[i];
        const double *row = gram + t->column[own] * t->size;
        for (j = 0; j < n; j++) t->a[i * n + j] = row[t->column[t->free[j]]] / (t->scale[own] * t->scale[t->free[j]]);
        t->a[i * n + i] += t->ridge;
        t->theta[i] = row[t->target] / t->scale[own];
    }
    if (!eliminated(t->a, t->theta, n)) return 0;
    for (i = 0; i < n; i++) t->theta[i] /= t->scale[t->free[i]];
    return 1;
}

/* a column with the wrong sign is taken out, the worst first; whether there was one */
static int taken_out(Task *t) {
    Py_ssize_t i, worst = -1;
    double most = 0.0;
    for (i = 0; i < t->frees; i++) {
        const double beyond = t->signs[t->free[i]] * t->theta[i];
        if (beyond < 0.0 && (worst < 0 || beyond * t->length[t->free[i]] < most))
            worst = i, most = beyond * t->length[t->free[i]];
    }
    if (worst < 0) return 0;
    t->frees--;
    for (i = worst; i < t->frees; i++) t->free[i] = t->free[i + 1];
    return 1;
}

/* one that was taken out is freed again, once, if its gradient has the right sign; whether there was one */
static int freed(Task *t) {
    const Py_ssize_t columns = t->size - 1;
    const double *total = t->stack, squares = total[t->target * t->size + t->target];
    double most = t->rounding * sqrt(squares > 0.0 ? squares : 0.0);
    Py_ssize_t i, k, best = -1;
    if (t->frees == columns) return 0;
    for (k = 0; k < columns; k++) {
        const double *row = total + t->column[k] * t->size;
        double left = row[t->target];
        int there = t->returned[k];
        for (i = 0; i < t->frees; i++) {
            there |= t->free[i] == k;
            left -= row[t->column[t->free[i]]] * t->theta[i];
        }
        left = left / t->length[k] * t->signs[k];
        if (!there && left > most) best = k, most = left;
    }
    if (best < 0) return 0;
    t->free[t->frees++] = best;
    t->returned[best] = 1;
    return 1;
}

static int run(Task *t) {
    const Py_ssize_t columns = t->size - 1;
    Py_ssize_t i, m;
    for (i = 0; i < columns; i++) {
        const Py_ssize_t at = t->column[i] = i + (i >= t->target);
        double sum = 0.0;
        for (m = 0; m < t->many; m++) sum += t->stack[(m * t->size + at) * t->size + at];
        t->scale[i] = sqrt(fmax(fabs(sum) / (double)t->many, 1e-300));
        t->length[i] = sqrt(fmax(t->stack[at * t->size + at], 1e-300));
        t->free[i] = i;
    }
    t->frees = columns;
    do {
        do
            if (!fitted(t, 0)) return 0;
        while (taken_out(t));
    } while (freed(t));
    for (m = 0; m < t->many; m++) {
        if (m > 0 && !fitted(t, m)) return 0;
        for (i = 0; i < t->frees; i++) t->found[m * columns + t->free[i]] = t->theta[i];
    }
    return 1;
}

static PyObject *solved(PyObject *module, PyObject *args) {
    PyObject *objects[3];
    Py_buffer view[3];
    Task t = {0};
    double *room = NULL;
    int i, opened = 0, done = -1;
    (void)module;
    if (!PyArg_ParseTuple(args, "OnOddO", &objects[0], &t.target, &objects[1], &t.ridge, &t.rounding, &objects[2]))
        return NULL;
    for (; opened < 3; opened++)
        if (PyObject_GetBuffer(objects[opened], &view[opened],
                               opened == 2 ? PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE : PyBUF_C_CONTIGUOUS)) goto end;
    t.stack = view[0].buf, t.signs = view[1].buf, t.found = view[2].buf;
    t.size = view[1].len / (Py_ssize_t)sizeof(double) + 1;
    t.many = view[0].len / (Py_ssize_t)sizeof(double) / (t.size * t.size);
    if (t.many < 1 || t.target < 0 || t.target >= t.size ||
        view[0].len != t.many * t.size * t.size * (Py_ssize_t)sizeof(double) ||
        view[2].len != t.many * (t.size - 1) * (Py_ssize_t)sizeof(double)) {
        PyErr_SetString(PyExc_ValueError, "signed: matrices of the target and of a column for each sign are needed");
        goto end;
    }
    room = calloc((size_t)(t.size * (t.size + 6)), sizeof(double));
    if (room == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    t.scale = room, t.length = t.scale + t.size, t.theta = t.length + t.size;
    t.column = (Py_ssize_t *)(t.theta + t.size), t.free = t.column + t.size;
    t.returned = (char *)(t.free + t.size), t.a = room + 6 * t.size;
    done = run(&t);
end:
    free(room);
    for (i = 0; i < opened; i++) PyBuffer_Release(&view[i]);
    return done < 0 ? NULL : PyBool_FromLong(done);
}

static PyMethodDef methods[] = {
    {"solved", solved, METH_VARARGS, "solved(stack, target, signs, ridge, rounding, found) -> whether it could be"},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_signed",
    "Least squares with signs, compiled. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__signed(void) { return PyModuleDef_Init(&definition); }
