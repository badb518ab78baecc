/* Recursions over a whole log for effects with memory: each row depends on the row before.
 *
 *   one_pole   y_k = keep_k y_{k-1} + add_k
 *   slip       a spring that slips: z_k = clip(z_{k-1} + moved_k, -radius, radius)
 *   bouc_wen   hysteresis with one state
 *   load       the load of two masses that are coupled by spring and damper, with or without a gap
 *   driven     the same two masses under a force on the motor: what the load is given
 *
 * memory.py, general.py and one_state.py hold the readable twins: the same operations in the same order (built without
 * fused multiply-add), but for masses under one law, whose steps are taken at once: they differ by rounding.
 * CPython limited API and buffers of doubles only: no NumPy headers.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>

#define MOST 4

typedef struct { Py_buffer view[MOST]; int opened; Py_ssize_t rows; } Columns;

static void close_columns(Columns *c) {
    while (c->opened > 0) PyBuffer_Release(&c->view[--c->opened]);
}

/* `count` columns of doubles, all of one length, the last of them to be written */
static int open_columns(Columns *c, PyObject **objects, int count) {
    c->opened = 0;
    while (c->opened < count) {
        const int flags = c->opened == count - 1 ? PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE : PyBUF_C_CONTIGUOUS;
        if (PyObject_GetBuffer(objects[c->opened], &c->view[c->opened], flags)) break;
        c->opened++;
        if (c->view[c->opened - 1].len != c->view[0].len || c->view[0].len % (Py_ssize_t)sizeof(double)) {
            PyErr_SetString(PyExc_ValueError, "memory: columns of doubles of one length are needed");
            break;
        }
        if (c->opened == count) {
            c->rows = c->view[0].len / (Py_ssize_t)sizeof(double);
            return 0;
        }
    }
    close_columns(c);
    return -1;
}

static PyObject *one_pole(PyObject *module, PyObject *args) {
    PyObject *objects[3];
    Columns c;
    double y;
    Py_ssize_t k;
    (void)module;
    if (!PyArg_ParseTuple(args, "OOdO", &objects[0], &objects[1], &y, &objects[2])) return NULL;
    if (open_columns(&c, objects, 3)) return NULL;
    {
        const double *keep = c.view[0].buf, *add = c.view[1].buf;
        double *out = c.view[2].buf, last = y;  /* a local that nothing points to stays in a register */
        for (k = 0; k < c.rows; k++) out[k] = last = keep[k] * last + add[k];
        y = last;
    }
    close_columns(&c);
    return PyFloat_FromDouble(y);
}

static PyObject *slip(PyObject *module, PyObject *args) {
    PyObject *objects[2];
    Columns c;
    double radius, z;
    Py_ssize_t k;
    (void)module;
    if (!PyArg_ParseTuple(args, "OddO", &objects[0], &radius, &z, &objects[1])) return NULL;
    if (open_columns(&c, objects, 2)) return NULL;
    {
        const double *moved = c.view[0].buf;
        double *out = c.view[1].buf;
        for (k = 0; k < c.rows; k++) {
            z += moved[k];
            out[k] = z = z > radius ? radius : z < -radius ? -radius : z;
        }
    }
    close_columns(&c);
    return PyFloat_FromDouble(z);
}

/* one row of one_state.build_up: the state after a way, in distances; *mean on that way */
static double build_up(double way, double before, double exponent, double unloading, double *mean) {
    const double side = way > 0.0 ? 1.0 : -1.0, x = side * way, w = side * before, size = fabs(w);
    const double factor = w >= 0.0 ? 1.0 : 1.0 - unloading, power = pow(size, exponent - 1.0);
    const double rate = 1.0 - factor * power * size, bend = x * exponent * fabs(factor) * power;
    const double kept = bend > 0.0 ? -expm1(-bend) / bend : 1.0;
    const double half = bend > 1e-6 ? (1.0 - kept) / bend : 0.5 - bend / 6.0, most = size > 1.0 ? size : 1.0;
    const double end = w + x * kept * rate, middle = w + x * half * rate;
    if (way == 0.0) return *mean = before;
    *mean = side * (middle > most ? most : middle);
    return side * (end > most ? most : end);
}

static PyObject *bouc_wen(PyObject *module, PyObject *args) {
    PyObject *objects[2];
    Columns c;
    double exponent, unloading, h;
    Py_ssize_t k;
    (void)module;
    if (!PyArg_ParseTuple(args, "OdddO", &objects[0], &exponent, &unloading, &h, &objects[1])) return NULL;
    if (open_columns(&c, objects, 2)) return NULL;
    {
        const double *moved = c.view[0].buf;
        double *out = c.view[1].buf;
        for (k = 0; k < c.rows; k++) h = build_up(moved[k], h, exponent, unloading, &out[k]);
    }
    close_columns(&c);
    return PyFloat_FromDouble(h);
}

/* ---- two masses ------------------------------------------------------------------------------------------------ */

/* wa^2, 2 zeta wa, gap/2, wa, 1 / depth at which the damping of a contact is fully there */
typedef struct { double square, drag, half_gap, rate, fade; } Coupling;
typedef struct { double position, velocity, motor_velocity, interval; } Load;

/* how deep in contact the damping is fully there, as a share of gap/2 */
#define FULL_DAMPING 0.1

/* laws of the coupling, bits: no force; the damping fades in, or is fully there, on either flank */
enum { NO_FORCE = 1, FADING = 2, IN_CONTACT = 4, OTHER_FLANK = 2 };

static double contact(const Coupling *c, double depth, double closing, int *laws, int flank) {
    const double share = depth * c->fade;
    const double a = c->square * depth + c->drag * closing * (share < 1.0 ? share : 1.0);
    *laws |= a > 0.0 ? (share < 1.0 ? FADING : IN_CONTACT) << flank : NO_FORCE;
    return a > 0.0 ? a : 0.0;
}

/* acceleration of the load: `apart` = motor less load, `closing` = its rate; a contact pushes and never pulls.
 * The law that holds is added to the laws */
static double pull(const Coupling *c, double apart, double closing, int *laws) {
    if (c->half_gap == 0.0) return c->square * apart + c->drag * closing;
    if (apart > c->half_gap) return contact(c, apart - c->half_gap, closing, laws, 0);
    if (apart < -c->half_gap) return -contact(c, -apart - c->half_gap, -closing, laws, OTHER_FLANK);
    *laws |= NO_FORCE;
    return 0.0;
}

/* One classical Runge-Kutta step of h of the load's own position and speed, seen from a motor whose speed changes at
 * the rate slope. Returns the mean pull; the laws that hold on its way are added to the laws */
static double step(const Coupling *k, double slope, double h, double *apart, double *closing, int *laws) {
    const double q = *apart, v = *closing, q2 = q + 0.5 * h * (v + 0.25 * h * slope), v2 = v + 0.5 * h * slope;
    const double a1 = pull(k, q, v, laws), a2 = pull(k, q2, v2 - 0.5 * h * a1, laws);
    const double a3 = pull(k, q2 - 0.25 * h * h * a1, v2 - 0.5 * h * a2, laws);
    const double q4 = q + h * (v + 0.5 * h * slope), v4 = v + h * slope;
    const double a4 = pull(k, q4 - 0.5 * h * h * a2, v4 - h * a3, laws);
    *apart = q4 - h * h / 6.0 * (a1 + a2 + a3);
    *closing = v4 - h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    pull(k, *apart, *closing, laws);
    return (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0;
}

/* an interval is cut into steps of at most so many radians of the load's own oscillation; a step within which one law
 * ends and another begins is cut into PARTS */
#define STEP 0.2
#define STEP_WITH_GAP 0.1
#define PARTS 8
#define MOST_STEPS 10000.0

/* The same step where one linear law is sure to hold throughout, as the map that it then is: (apart, closing, what
 * drives the motor) -> (apart, closing). The numbers are those of the step, for a part of its work */
typedef struct { double qq, qv, qp, vq, vv, vp; } Map;

static Map linear_load(Coupling k, double h) {
    Map m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
    int laws = 0;
    k.half_gap = 0.0;
    step(&k, 0.0, h, &m.qq, &m.vq, &laws), step(&k, 0.0, h, &m.qv, &m.vv, &laws);
    step(&k, 1.0, h, &m.qp, &m.vp, &laws);
    return m;
}

/* whether the law at a flank holds for a whole step from there: no point of it comes near the play or a pull. Pulls
 * stay below twice the first one, if that is more than what they can change by */
static int stays_in_contact(const Coupling *k, double depth, double v, double push, double lighter, double h) {
    const double pulls = k->square * depth + k->drag * v, most = fabs(push) + 2.0 * lighter * fabs(pulls);
    const double moved = h * (fabs(v) + h * most);
    return (depth - moved) * k->fade > 1.0 && pulls > k->square * moved + k->drag * h * most;
}

static int stays_free(const Coupling *k, double q, double v, double push, double h) {
    return fabs(q) + h * (fabs(v) + h * fabs(push)) < k->half_gap;
}

/* so many steps as one */
static Map repeated(const Map *m, Py_ssize_t steps) {
    Map all = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
    Py_ssize_t i;
    for (i = 0; i < steps; i++)
        all = (Map){m->qq * all.qq + m->qv * all.vq, m->qq * all.qv + m->qv * all.vv,
                    m->qq * all.qp + m->qv * all.vp + m->qp, m->vq * all.qq + m->vv * all.vq,
                    m->vq * all.qv + m->vv * all.vv, m->vq * all.qp + m->vv * all.vp + m->vp};
    return all;
}

/* a time h during which one law is sure to hold, by its map (that of a contact); 0 where none is, and nothing moves.
 * rate = 1 / (h lighter): a division would be most of what a row takes */
static inline int by_one_law(const Coupling *k, const Map *map, double push, double lighter, double h, double rate,
                             double *apart, double *closing, double *mean) {
    const double q = *apart, v = *closing, side = q < 0.0 ? -1.0 : 1.0, depth = side * q - k->half_gap;
    if (k->half_gap > 0.0 && depth < 0.0) {
        if (!stays_free(k, q, v, push, h)) return 0;
        *apart = q + h * (v + 0.5 * h * push);
        *closing = v + h * push;
        *mean = 0.0;
        return 1;
    }
    if (k->half_gap > 0.0 && !stays_in_contact(k, depth, side * v, side * push, lighter, h)) return 0;
    *apart = map->qq * side * depth + map->qv * v + map->qp * push + side * k->half_gap;
    *closing = map->vq * side * depth + map->vv * v + map->vp * push;
    *mean = (push * h - (*closing - v)) * rate;
    return 1;
}

typedef struct { double interval, rate; Py_ssize_t steps; Map once, all; } Clock;

static void set_clock(Clock *clock, const Coupling *k, double interval) {
    double count = ceil(k->rate * interval / (k->half_gap > 0.0 ? STEP_WITH_GAP : STEP));
    if (!(count >= 1.0)) count = 1.0;
    if (count > MOST_STEPS) count = MOST_STEPS;
    clock->interval = interval;
    clock->rate = 1.0 / interval;
    clock->steps = (Py_ssize_t)count;
    clock->once = linear_load(*k, interval / count);
    clock->all = repeated(&clock->once, clock->steps);
}

/* `advance` of a load that hangs on a spring and damper alone: what waits for the row before is three operations long */
static inline double hanging(const Clock *clock, double position, double velocity, double slope, Load *load) {
    const Map *m = &clock->all;
    const double moved = 0.5 * clock->interval * velocity, sped = 0.5 * clock->interval * slope;
    const double a = position - moved, b = velocity - sped, q = load->position, v = load->velocity;
    const double place = position + moved - m->qq * a - m->qv * b - m->qp * slope;
    const double speed = velocity + sped - m->vq * a - m->vv * b - m->vp * slope;
    load->position = place + (m->qq * q + m->qv * v);
    load->velocity = speed + (m->vq * q + m->vv * v);
    return (load->velocity - v) * clock->rate;
}

/* mean acceleration of the load over an interval behind a motor that moves along a parabola: mean of its end positions,
 * mean speed, rate of that */
static double advance(const Coupling *k, const Clock *clock, double position, double velocity, double slope,
                      Load *load) {
    const double t = clock->interval, h = t / (double)clock->steps, often = (double)clock->steps * clock->rate;
    double apart = position - 0.5 * t * velocity - load->position, sum = 0.0, mean;
    double closing = velocity - 0.5 * t * slope - load->velocity;
    Py_ssize_t i, j;
    if (!(k->half_gap > 0.0)) return hanging(clock, position, velocity, slope, load);
    if (!by_one_law(k, &clock->all, slope, 1.0, t, clock->rate, &apart, &closing, &mean)) {
        for (i = 0; i < clock->steps; i++) {
            if (!by_one_law(k, &clock->once, slope, 1.0, h, often, &apart, &closing, &mean)) {
                double q = apart, v = closing;
                int laws = 0;
                mean = step(k, slope, h, &apart, &closing, &laws);
                if (laws & (laws - 1)) {
                    apart = q, closing = v, mean = 0.0;
                    for (j = 0; j < PARTS; j++)
                        mean += step(k, slope, h / PARTS, &apart, &closing, &laws) / PARTS;
                }
            }
            sum += mean;
        }
        mean = sum / (double)clock->steps;
    }
    load->position = position + 0.5 * t * velocity - apart;
    if (mean != 0.0) load->velocity = velocity + 0.5 * t * slope - closing;  /* in the gap it keeps its speed */
    return mean;
}

/* mean acceleration of the load in a row, which leaves the load as it then is; in an instant (t = 0) nothing moves */
static double one_row(const Coupling *k, Clock *clock, double position, double velocity, double t, Load *load) {
    const double slope = (velocity - load->motor_velocity) / (0.5 * (t + load->interval));
    int laws = 0;
    if (t == 0.0) return pull(k, position - load->position, velocity - load->velocity, &laws);
    if (t != clock->interval) set_clock(clock, k, t);
    load->motor_velocity = velocity;
    load->interval = t;
    return advance(k, clock, position, velocity, slope, load);
}

/* rows of one length for a load without play, until another comes: how many */
static Py_ssize_t linear_rows(const Coupling *k, const Clock *clock, const double *position, const double *velocity,
                              const double *interval, Py_ssize_t rows, Load *load, double *out) {
    Load own = *load;  /* a local that nothing points to stays in registers */
    Py_ssize_t i;
    if (k->half_gap > 0.0 || own.interval != clock->interval) return 0;
    for (i = 0; i < rows && interval[i] == clock->interval; i++) {
        const double slope = (velocity[i] - own.motor_velocity) / clock->interval;
        own.motor_velocity = velocity[i];
        out[i] = hanging(clock, position[i], velocity[i], slope, &own);
    }
    *load = own;
    return i;
}

static PyObject *load_rows(PyObject *module, PyObject *args) {
    PyObject *objects[4];
    Columns c;
    Coupling k;
    Clock clock = {.interval = -1.0};
    Load load;
    Py_ssize_t i;
    (void)module;
    if (!PyArg_ParseTuple(args, "OOO(dddd)(dddd)O", &objects[0], &objects[1], &objects[2], &k.square, &k.drag,
                          &k.half_gap, &k.rate, &load.position, &load.velocity, &load.motor_velocity, &load.interval,
                          &objects[3])) return NULL;
    if (open_columns(&c, objects, 4)) return NULL;
    k.fade = 1.0 / (FULL_DAMPING * k.half_gap);
    {
        const double *position = c.view[0].buf, *velocity = c.view[1].buf, *interval = c.view[2].buf;
        double *out = c.view[3].buf;
        Py_BEGIN_ALLOW_THREADS
        for (i = 0; i < c.rows; i++) {
            i += linear_rows(&k, &clock, position + i, velocity + i, interval + i, c.rows - i, &load, out + i);
            if (i < c.rows) out[i] = one_row(&k, &clock, position[i], velocity[i], interval[i], &load);
        }
        Py_END_ALLOW_THREADS
    }
    close_columns(&c);
    return Py_BuildValue("(dddd)", load.position, load.velocity, load.motor_velocity, load.interval);
}

/* the same for one row alone, as a simulation asks for it */
static PyObject *load_row(PyObject *module, PyObject *args) {
    Coupling k;
    Clock clock = {.interval = -1.0};
    Load load;
    double position, velocity, t, mean;
    (void)module;
    if (!PyArg_ParseTuple(args, "ddd(dddd)(dddd)", &position, &velocity, &t, &k.square, &k.drag, &k.half_gap, &k.rate,
                          &load.position, &load.velocity, &load.motor_velocity, &load.interval)) return NULL;
    k.fade = 1.0 / (FULL_DAMPING * k.half_gap);
    mean = one_row(&k, &clock, position, velocity, t, &load);
    return Py_BuildValue("d(dddd)", mean, load.position, load.velocity, load.motor_velocity, load.interval);
}

/* apart and closing of two masses: closing' = push - lighter pull, lighter = 1 / the motor's share of the inertia.
 * Returns the mean pull of the load over a step of h; the laws that hold on its way are added to the laws */
static double pair_step(const Coupling *k, double push, double lighter, double h, double *apart, double *closing,
                        int *laws) {
    const double q = *apart, v = *closing;
    const double p1 = pull(k, q, v, laws), a1 = push - p1 * lighter;
    const double v2 = v + 0.5 * h * a1, p2 = pull(k, q + 0.5 * h * v, v2, laws), a2 = push - p2 * lighter;
    const double v3 = v + 0.5 * h * a2, p3 = pull(k, q + 0.5 * h * v2, v3, laws), a3 = push - p3 * lighter;
    const double v4 = v + h * a3, p4 = pull(k, q + h * v3, v4, laws), a4 = push - p4 * lighter;
    *apart = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
    *closing = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    return (p1 + 2.0 * p2 + 2.0 * p3 + p4) / 6.0;
}

/* the map of that step under one linear law */
static Map linear_pair(Coupling k, double lighter, double h) {
    Map m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
    int laws = 0;
    k.half_gap = 0.0;
    pair_step(&k, 0.0, lighter, h, &m.qq, &m.vq, &laws), pair_step(&k, 0.0, lighter, h, &m.qv, &m.vv, &laws);
    pair_step(&k, 1.0, lighter, h, &m.qp, &m.vp, &laws);
    return m;
}

/* a step, cut where one law ends and another begins */
static double cut_step(const Coupling *k, double push, double lighter, double h, double *apart, double *closing) {
    int laws = 0, n;
    double q = *apart, v = *closing, mean = pair_step(k, push, lighter, h, &q, &v, &laws);
    if (laws & (laws - 1)) {
        q = *apart, v = *closing, mean = 0.0;
        for (n = 0; n < PARTS; n++) mean += pair_step(k, push, lighter, h / PARTS, &q, &v, &laws) / PARTS;
    }
    *apart = q, *closing = v;
    return mean;
}

/* out = mean acceleration of the load per interval; push = acceleration of a free motor, constant in each interval */
static PyObject *driven_rows(PyObject *module, PyObject *args) {
    PyObject *objects[2];
    Columns c;
    Coupling k;
    double interval, own, apart = 0.0, closing = 0.0;
    Py_ssize_t i, j, steps;
    (void)module;
    if (!PyArg_ParseTuple(args, "O(dddd)ddnO", &objects[0], &k.square, &k.drag, &k.half_gap, &k.rate, &own, &interval,
                          &steps, &objects[1])) return NULL;
    if (open_columns(&c, objects, 2)) return NULL;
    k.fade = 1.0 / (FULL_DAMPING * k.half_gap);
    {
        const double *push = c.view[0].buf;
        double *out = c.view[1].buf;
        const double h = interval / (double)steps, lighter = 1.0 / own, rate = own / interval, often = own / h;
        const Map once = linear_pair(k, lighter, h), all = repeated(&once, steps);
        Py_BEGIN_ALLOW_THREADS
        for (i = 0; i < c.rows; i++) {
            double sum = 0.0, mean;
            if (by_one_law(&k, &all, push[i], lighter, interval, rate, &apart, &closing, &out[i])) continue;
            for (j = 0; j < steps; j++) {
                if (!by_one_law(&k, &once, push[i], lighter, h, often, &apart, &closing, &mean))
                    mean = cut_step(&k, push[i], lighter, h, &apart, &closing);
                sum += mean;
            }
            out[i] = sum / (double)steps;
        }
        Py_END_ALLOW_THREADS
    }
    close_columns(&c);
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"one_pole", one_pole, METH_VARARGS, "one_pole(keep, add, before, out) -> the last value"},
    {"slip", slip, METH_VARARGS, "slip(moved, radius, before, out) -> the last state"},
    {"bouc_wen", bouc_wen, METH_VARARGS, "bouc_wen(moved, exponent, unloading, before, out) -> the last state"},
    {"load", load_rows, METH_VARARGS, "load(position, velocity, interval, coupling, state, out) -> state"},
    {"load_row", load_row, METH_VARARGS, "load_row(position, velocity, interval, coupling, state) -> (mean, state)"},
    {"driven", driven_rows, METH_VARARGS, "driven(push, coupling, own, interval, steps, out)"},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};
static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_memory", "Compiled recursions of effects with memory.",
                                        0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__memory(void) { return PyModuleDef_Init(&definition); }
