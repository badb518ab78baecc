/* Columns as lines of CSV: places in a list of texts, and numbers most of which are decimals of few places.
 *
 * A double v is the decimal m / 10^p, m < 10^15, if it is the double nearest to it, which the quotient of the two tells
 * exactly. No two decimals of 15 digits share a double: m / 10^p without its last zeros is then the shortest text that
 * reads as v, the one that Arrow finds by a search. The texts of other numbers come from there (csv_text.py).
 *
 * CPython limited API and buffers only: no NumPy headers.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define MOST_PLACES 9
#define MOST 1e15
#define LARGEST 1e10            /* from here on, and below 1e-6, Arrow writes an exponent */
#define LONGEST 17              /* sign, 15 digits, point */
#define FIRST 256               /* as many values are looked at before all are */
#define DIGITS 16

static const double SCALE[MOST_PLACES + 1] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
static const char PAIRS[] =
    "00010203040506070809101112131415161718192021222324252627282930313233343536373839404142434445464748495051525354555657"
    "585960616263646566676869707172737475767778798081828384858687888990919293949596979899";

/* ---- which numbers are decimals ------------------------------------------------------------------------------- */

/* v * scale as a whole number, halves to even; |v * scale| < MOST */
static inline double whole(double v, double scale) {
    const double shift = 6755399441055744.0;    /* 1.5 * 2^52 */
    return (v * scale + shift) - shift;
}

/* Is v written without an exponent, as a decimal of so many places? `rounded`: it only has to be small enough. */
static inline int fits(double v, double scale, int rounded) {
    const double size = fabs(v) * scale;
    if (!(size < MOST && fabs(v) < LARGEST)) return !isfinite(v);
    if (rounded) return 1;
    return whole(v, scale) / scale == v && (v == 0.0 ? !signbit(v) : fabs(v) >= 1e-6);
}

/* writes down which fit; stops where more than `most` do not. Returns how many do not. */
static Py_ssize_t mark(const double *v, Py_ssize_t n, double scale, int rounded, Py_ssize_t most, uint8_t *marks) {
    Py_ssize_t i, others = 0;
    for (i = 0; i < n && others <= most; i++) others += !(marks[i] = (uint8_t)fits(v[i], scale, rounded));
    return others;
}

static int few(const double *v, Py_ssize_t n, double scale, uint8_t *marks) {
    return mark(v, n, scale, 0, n / 2, marks) <= n / 2;
}

/* marks(values, places, marks) -> places: into `marks` (a byte each) which values are decimals of so many places.
 * places < 0: the fewest of which half of the values and more are; -1 and no marks if there are none. */
static PyObject *marks(PyObject *module, PyObject *args) {
    Py_buffer values, out;
    Py_ssize_t n;
    int places, good;
    (void)module;
    if (!PyArg_ParseTuple(args, "y*iw*", &values, &places, &out)) return NULL;
    n = values.len / (Py_ssize_t)sizeof(double);
    good = values.len == n * (Py_ssize_t)sizeof(double) && out.len == n && places <= MOST_PLACES;
    if (good && places >= 0) mark(values.buf, n, SCALE[places], 1, n, out.buf);
    else if (good) {
        for (places = 0; places <= MOST_PLACES; places++)
            if (few(values.buf, n < FIRST ? n : FIRST, SCALE[places], out.buf)
                && few(values.buf, n, SCALE[places], out.buf)) break;
        if (places > MOST_PLACES) {
            places = -1;
            memset(out.buf, 0, (size_t)n);
        }
    }
    PyBuffer_Release(&values);
    PyBuffer_Release(&out);
    if (!good) {
        PyErr_SetString(PyExc_ValueError, "csv_text: doubles, up to 9 places and a byte each are needed");
        return NULL;
    }
    return PyLong_FromLong(places);
}

/* ---- lines ---------------------------------------------------------------------------------------------------- */

enum { VALUES, MARKS, ENDS, TEXTS, BUFFERS };

typedef struct {
    Py_buffer view[BUFFERS];
    int places;                 /* -1: values are places in the list of texts */
    Py_ssize_t count, next;     /* texts in all; the next one of a number that is no decimal */
    Py_ssize_t longest;
} Column;

/* without `behind` bytes at its end; `to` has room for 2 * DIGITS more than the text */
static inline char *put_text(char *to, const Column *c, Py_ssize_t at, int behind) {
    const int32_t *ends = c->view[ENDS].buf;
    const char *text = (const char *)c->view[TEXTS].buf + ends[at];
    const Py_ssize_t n = ends[at + 1] - ends[at] - behind;
    if (n <= DIGITS && ends[at] + DIGITS <= c->view[TEXTS].len) memcpy(to, text, DIGITS);    /* two moves, no call */
    else memcpy(to, text, (size_t)n);
    return to + n;
}

/* the digits of v as a decimal, without zeros at the end of the fraction; `to` has room for 2 * DIGITS more */
static char *put_decimal(char *to, double v, int places) {
    char digits[3 * DIGITS], *const end = digits + 2 * DIGITS, *first = end;
    uint64_t m;
    int64_t all;
    int before;
    if (!isfinite(v)) {
        const char *text = isnan(v) ? "nan" : v < 0.0 ? "-inf" : "inf";
        memcpy(to, text, 4);
        return to + strlen(text);
    }
    all = (int64_t)whole(v, SCALE[places]);
    *to = '-';
    to += all < 0;
    m = (uint64_t)(all < 0 ? -all : all);
    while (places > 0 && m % 10 == 0) { m /= 10; places--; }
    while (m >= 10) { first -= 2; memcpy(first, PAIRS + 2 * (m % 100), 2); m /= 100; }
    if (m > 0) *--first = (char)('0' + m);
    while (end - first <= places) *--first = '0';
    before = (int)(end - first) - places;
    memcpy(to, first, DIGITS);
    to += before;
    if (places == 0) return to;
    *to++ = '.';
    memcpy(to, first + before, DIGITS);
    return to + places;
}

/* One cell; NULL if the column has no text for it. */
static inline char *put(char *to, Column *c, Py_ssize_t row) {
    if (c->places < 0) {
        const int32_t at = ((const int32_t *)c->view[VALUES].buf)[row];
        return at < 0 || at >= c->count ? NULL : put_text(to, c, at, 0);
    }
    if (((const uint8_t *)c->view[MARKS].buf)[row])
        return put_decimal(to, ((const double *)c->view[VALUES].buf)[row], c->places);
    return c->next >= c->count ? NULL : put_text(to, c, c->next++, 1);
}

static char *put_lines(char *to, Column *columns, Py_ssize_t width, Py_ssize_t rows) {
    Py_ssize_t i, c;
    for (i = 0; i < rows; i++) {
        for (c = 0; c < width; c++) {
            if (!(to = put(to, &columns[c], i))) return NULL;
            *to++ = ',';
        }
        to[-1] = '\n';
    }
    return to;
}

/* what a column gives is of one length, and its texts lie within their bytes */
static int checked(Column *c, Py_ssize_t rows) {
    const int32_t *ends = c->view[ENDS].buf;
    Py_ssize_t i;
    c->next = 0;
    c->count = c->view[ENDS].len / (Py_ssize_t)sizeof(int32_t) - 1;
    c->longest = c->places < 0 ? 0 : LONGEST;
    if (c->count < 0 || c->places > MOST_PLACES || ends[0] < 0 || ends[c->count] > c->view[TEXTS].len) return 0;
    for (i = 0; i < c->count; i++) {
        if (ends[i + 1] - ends[i] < (c->places >= 0)) return 0;
        if (ends[i + 1] - ends[i] > c->longest) c->longest = ends[i + 1] - ends[i];
    }
    if (c->places < 0) return c->view[VALUES].len == rows * (Py_ssize_t)sizeof(int32_t);
    return c->view[VALUES].len == rows * (Py_ssize_t)sizeof(double) && c->view[MARKS].len == rows;
}

/* lines(rows, [(places, values, marks, ends, texts)], out) -> how many bytes were written; below 0: no byte was, `out` must
 * have as many. places < 0: values (int32) are places in the list of texts, which lie one after the other, each from one of
 * the `ends` (int32) to the next. Else values are doubles, decimals of so many places where marked, and the list has the
 * texts of the others in their order, each with one byte behind it that is left out (its line end). */
static PyObject *lines(PyObject *module, PyObject *args) {
    PyObject *list;
    Py_buffer out;
    Py_ssize_t rows, width, opened, i, needed = 2 * DIGITS, written = 0;
    Column *columns;
    int good;
    (void)module;
    if (!PyArg_ParseTuple(args, "nOw*", &rows, &list, &out)) return NULL;
    width = PyList_Size(list);
    columns = width > 0 ? PyMem_Malloc(sizeof(Column) * (size_t)width) : NULL;
    good = columns && rows >= 0;
    for (opened = 0; good && opened < width; opened++) {
        Column *c = &columns[opened];
        Py_buffer *v = c->view;
        if (!PyArg_ParseTuple(PyList_GetItem(list, opened), "iy*y*y*y*", &c->places, &v[VALUES], &v[MARKS], &v[ENDS],
                              &v[TEXTS])) break;
        good = checked(c, rows);
        needed += rows * (c->longest + 1);
    }
    good = good && opened == width;
    if (good && out.len < needed) written = -needed;
    else if (good) {
        char *end;
        Py_BEGIN_ALLOW_THREADS
        end = put_lines(out.buf, columns, width, rows);
        Py_END_ALLOW_THREADS
        good = end != NULL;
        written = good ? end - (char *)out.buf : 0;
    }
    while (opened-- > 0) for (i = 0; i < BUFFERS; i++) PyBuffer_Release(&columns[opened].view[i]);
    PyMem_Free(columns);
    PyBuffer_Release(&out);
    if (good) return PyLong_FromSsize_t(written);
    if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "csv_text: columns that do not fit each other");
    return NULL;
}

static PyMethodDef methods[] = {
    {"marks", marks, METH_VARARGS, "marks(values, places, marks) -> places"},
    {"lines", lines, METH_VARARGS, "lines(rows, [(places, values, marks, ends, texts)], out) -> bytes written"},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_csv_text",
    "Columns as lines of CSV. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__csv_text(void) { return PyModuleDef_Init(&definition); }
