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

/* wa^2, 2 zeta wa, gap/2, wa, what its own friction slows a load that slides */
typedef struct { double square, drag, half_gap, rate, slowing; } Coupling;
typedef struct { double position, velocity, motor_velocity, interval; } Load;

/* Motor less load is `apart`, its rate `closing`; closing' = push - lighter pull, with a push that is constant on the
 * way. Of a load behind its motor the push is the motor's acceleration, and lighter is 1; where a force drives both,
 * lighter is 1 / the motor's share of the inertia. Every function is that of the same name in memory.py */

/* the flank that pushes, or 0 */
static double side_of(const Coupling *k, double apart, double closing) {
    const double flank = apart < 0.0 ? -1.0 : 1.0, depth = flank * apart - k->half_gap;
    return depth >= 0.0 && k->square * depth + k->drag * flank * closing > 0.0 ? flank : 0.0;
}

static double pull(const Coupling *k, double apart, double closing) {
    double side = 0.0;
    if (k->half_gap > 0.0 && (side = side_of(k, apart, closing)) == 0.0) return 0.0;
    return k->square * (apart - side * k->half_gap) + k->drag * closing;
}

static double rises(double value, double rate, double bend, double most) {
    const double square = rate * rate - 2.0 * bend * value;
    double root, at;
    if (square < 0.0) return most;
    root = sqrt(square);
    if (rate > 0.0) at = -2.0 * value / (rate + root);
    else if (bend == 0.0) return most;
    else at = (root - rate) / bend;
    return 0.0 <= at && at < most ? at : most;
}

static void swung(const Coupling *k, double push, double lighter, double h, double *apart, double *closing) {
    const double q = *apart, v = *closing, a = push - lighter * (k->square * q + k->drag * v);
    const double b = -lighter * (k->square * v + k->drag * a), c = -lighter * (k->square * a + k->drag * b);
    const double d = -lighter * (k->square * b + k->drag * c);
    *apart = q + h * (v + h / 2.0 * (a + h / 3.0 * (b + h / 4.0 * c)));
    *closing = v + h * (a + h / 2.0 * (b + h / 3.0 * (c + h / 4.0 * d)));
}

/* the flank that pushes next, 0 if none does; *when */
static double touches(const Coupling *k, double push, double left, double q, double v, double *when) {
    const double flank = q < 0.0 ? -1.0 : 1.0, depth = flank * q - k->half_gap, w = flank * v, p = flank * push;
    const double far = rises(-depth - 2.0 * k->half_gap, -w, -p, left);
    double near = rises(depth, w, p, left);
    if (depth >= 0.0) {
        const double force = k->square * depth + k->drag * w, rate = k->square * w + k->drag * p;
        const double again = rises(force, rate, k->square * p, left);
        if (again < near && depth + again * (w + 0.5 * again * p) >= 0.0) near = again;
    }
    *when = near < far ? near : far;
    return near < far ? flank : far < left ? -flank : 0.0;
}

static double leaves(const Coupling *k, double push, double lighter, double left, double depth, double w) {
    const double force = k->square * depth + k->drag * w;
    double last = depth, speed = w, rate, after;
    swung(k, push, lighter, left, &last, &speed);
    after = k->square * last + k->drag * speed;
    if (after >= 0.0) return left;
    rate = k->square * w + k->drag * (push - lighter * force);
    return rises(-force, -rate, 2.0 * (force + rate * left - after) / (left * left), left);
}

/* beginnings and ends of contacts that are found in a step */
#define EVENTS 6

/* over a short time, from one event to the next; returns what contact took from closing */
static double over(const Coupling *k, double push, double lighter, double h, double *apart, double *closing) {
    double side = side_of(k, *apart, *closing), left = h, q = *apart, v = *closing, taken = 0.0, s;
    int i;
    for (i = 0; i < EVENTS && left > 0.0; i++) {
        if (side == 0.0) {
            side = touches(k, push, left, q, v, &s);
            q += s * (v + 0.5 * s * push);
            v += s * push;
        } else {
            double depth = side * q - k->half_gap, w = side * v;
            s = leaves(k, side * push, lighter, left, depth, w);
            swung(k, side * push, lighter, s, &depth, &w);
            taken = taken + push * s - (side * w - v);
            q = side * (depth + k->half_gap), v = side * w;
            if (s < left) side = 0.0;
        }
        left -= s;
    }
    *apart = q + left * (v + 0.5 * left * push);
    *closing = v + left * push;
    return taken;
}

/* an interval is cut into steps of at most so many radians of the load's own oscillation, and time constants of the
 * damper */
#define STEP 0.2
#define SETTLING 1.0
#define MOST_STEPS 10000.0

/* The same where one linear law is sure to hold throughout, as the map that it then is: (apart, closing, push) ->
 * (apart, closing). The numbers are those of `swung`, for a part of its work */
typedef struct { double qq, qv, qp, vq, vv, vp; } Map;

static Map linear(const Coupling *k, double lighter, double h) {
    Map m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
    swung(k, 0.0, lighter, h, &m.qq, &m.vq), swung(k, 0.0, lighter, h, &m.qv, &m.vv);
    swung(k, 1.0, lighter, h, &m.qp, &m.vp);
    return m;
}

/* whether the law at a flank holds for a whole step from there: no point of it comes near a pull. Pulls stay below
 * twice the first one, if that is more than what they can change by */
static int stays_in_contact(const Coupling *k, double depth, double v, double push, double lighter, double h) {
    const double pulls = k->square * depth + k->drag * v, most = fabs(push) + 2.0 * lighter * fabs(pulls);
    return pulls > h * (k->square * (fabs(v) + h * most) + k->drag * most);
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

typedef struct { double interval, rate, lighter; Py_ssize_t steps; Map once, all; } Clock;

static Clock clock_of(const Coupling *k, double interval, double lighter, Py_ssize_t steps) {
    Clock clock = {.interval = interval, .rate = 1.0 / interval, .lighter = lighter, .steps = steps};
    clock.once = linear(k, lighter, interval / (double)steps);
    clock.all = repeated(&clock.once, steps);
    return clock;
}

static void set_clock(Clock *clock, const Coupling *k, double interval) {
    const double swings = k->rate / STEP, settles = k->drag / SETTLING;
    double count = ceil(interval * (swings > settles ? swings : settles));
    if (!(count >= 1.0)) count = 1.0;
    if (count > MOST_STEPS) count = MOST_STEPS;
    *clock = clock_of(k, interval, 1.0, (Py_ssize_t)count);
}

/* what its own friction takes of a load's speed in h: no more than all of it */
static inline double rubbed(const Coupling *k, double h, double speed) {
    const double most = k->slowing * h;
    return speed > most ? most : speed < -most ? -most : speed;
}

/* mean pull over an interval, which moves what lies between motor and load, and the speed of the load */
static double mean_over(const Coupling *k, const Clock *clock, double push, double *apart, double *closing,
                        double *speed) {
    const double t = clock->interval, n = (double)clock->steps, h = t / n, rate = clock->rate / clock->lighter;
    double sum = 0.0, mean, slow;
    Py_ssize_t i;
    if (k->slowing == 0.0 && by_one_law(k, &clock->all, push, clock->lighter, t, rate, apart, closing, &mean)) {
        *speed += t * mean;
        return mean;
    }
    for (i = 0; i < clock->steps; i++) {
        if (!by_one_law(k, &clock->once, push, clock->lighter, h, n * rate, apart, closing, &mean))
            mean = over(k, push, clock->lighter, h, apart, closing) * (n * rate);
        sum += mean;
        *speed += h * mean;
        if (k->slowing == 0.0) continue;
        slow = rubbed(k, h, *speed);
        *apart += 0.5 * h * slow, *closing += slow, *speed -= slow;
    }
    return sum / n;
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
    const double t = clock->interval;
    double apart = position - 0.5 * t * velocity - load->position, mean;
    double closing = velocity - 0.5 * t * slope - load->velocity;
    if (!(k->half_gap > 0.0 || k->slowing > 0.0)) return hanging(clock, position, velocity, slope, load);
    mean = mean_over(k, clock, slope, &apart, &closing, &load->velocity);
    load->position = position + 0.5 * t * velocity - apart;
    return mean;
}

/* mean acceleration of the load in a row, which leaves the load as it then is; in an instant (t = 0) nothing moves */
static double one_row(const Coupling *k, Clock *clock, double position, double velocity, double t, Load *load) {
    const double slope = (velocity - load->motor_velocity) / (0.5 * (t + load->interval));
    if (t == 0.0) return pull(k, position - load->position, velocity - load->velocity);
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
    if (k->half_gap > 0.0 || k->slowing > 0.0 || own.interval != clock->interval) return 0;
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
    if (!PyArg_ParseTuple(args, "OOO(ddddd)(dddd)O", &objects[0], &objects[1], &objects[2], &k.square, &k.drag,
                          &k.half_gap, &k.rate, &k.slowing, &load.position, &load.velocity, &load.motor_velocity, &load.interval,
                          &objects[3])) return NULL;
    if (open_columns(&c, objects, 4)) return NULL;
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
    if (!PyArg_ParseTuple(args, "ddd(ddddd)(dddd)", &position, &velocity, &t, &k.square, &k.drag, &k.half_gap, &k.rate,
                          &k.slowing, &load.position, &load.velocity, &load.motor_velocity, &load.interval)) return NULL;
    mean = one_row(&k, &clock, position, velocity, t, &load);
    return Py_BuildValue("d(dddd)", mean, load.position, load.velocity, load.motor_velocity, load.interval);
}

/* out = mean pull on the load per interval; push = acceleration of a free motor, constant in each interval, whose
 * velocity is that at its begin */
static PyObject *driven_rows(PyObject *module, PyObject *args) {
    PyObject *objects[3];
    Columns c;
    Coupling k;
    double interval, own, apart, closing = 0.0;
    Py_ssize_t i, steps;
    (void)module;
    if (!PyArg_ParseTuple(args, "OO(ddddd)ddndO", &objects[0], &objects[1], &k.square, &k.drag, &k.half_gap, &k.rate,
                          &k.slowing, &own, &interval, &steps, &apart, &objects[2])) return NULL;
    if (open_columns(&c, objects, 3)) return NULL;
    {
        const double *push = c.view[0].buf, *velocity = c.view[1].buf;
        double *out = c.view[2].buf;
        const Clock clock = clock_of(&k, interval, 1.0 / own, steps);
        Py_BEGIN_ALLOW_THREADS
        for (i = 0; i < c.rows; i++) {
            double speed = velocity[i] - closing;
            out[i] = mean_over(&k, &clock, push[i], &apart, &closing, &speed);
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
    {"driven", driven_rows, METH_VARARGS, "driven(push, velocity, coupling, own, interval, steps, apart, out)"},
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_memory",
    "Compiled recursions of effects with memory. " DSD_SOURCE,  // which source this is of: `signals.compiled`
    0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__memory(void) { return PyModuleDef_Init(&definition); }
