
#include <string.h>
#include <time.h>

/* What follows is the border to Python: arguments are checked and taken apart by the
 * program of their entry, a character a leaf, and results are put together.
 *
 *   d i b    a double, an int, a bool          n      None
 *   v V m M  a vector or a matrix, written     r R    a record, written
 *            and their least sizes                    and its bytes
 *   ( )      a tuple                           < >    a named tuple, its number before
 *
 * The stable ABI of Python 3.11 is declared here, so that no headers need be there. */

typedef intptr_t Py_ssize_t;
typedef struct _object {
    Py_ssize_t references;
    const void *type;
} PyObject;
typedef struct {
    void *buf;
    PyObject *obj;
    Py_ssize_t len, itemsize;
    int readonly, ndim;
    char *format;
    Py_ssize_t *shape, *strides, *suboffsets;
    void *internal;
} Py_buffer;
typedef PyObject *(*PyCFunction)(PyObject *, PyObject *const *, Py_ssize_t);
typedef PyObject *(*newfunc)(PyObject *, PyObject *, PyObject *);
typedef PyObject *(*allocfunc)(PyObject *, Py_ssize_t);
typedef struct { const char *name; PyCFunction call; int flags; const char *doc; } PyMethodDef;
typedef struct {
    Py_ssize_t references;
    void *type, *init;
    Py_ssize_t index;
    PyObject *copy;
    const char *name, *doc;
    Py_ssize_t size;
    PyMethodDef *methods;
    void *slots, *traverse, *clear, *free;
} PyModuleDef;
enum { METH_FASTCALL = 0x80, ABI = 3, TP_ALLOC = 47, TP_NEW = 65 };
enum { WRITABLE = 0x1, FORMAT = 0x4, STRIDED = 0x18, CONTIGUOUS = 0x38 };

extern PyObject *PyExc_TypeError, *PyExc_ValueError, *PyExc_OverflowError, _Py_NoneStruct;
extern PyObject PyFloat_Type, PyLong_Type, PyTuple_Type, PyType_Type;
extern PyObject *PyErr_Format(PyObject *, const char *, ...);
extern PyObject *PyErr_Occurred(void);
extern void PyErr_Clear(void);
extern void Py_IncRef(PyObject *);
extern void Py_DecRef(PyObject *);
extern double PyFloat_AsDouble(PyObject *);
extern PyObject *PyFloat_FromDouble(double);
extern long long PyLong_AsLongLong(PyObject *);
extern PyObject *PyLong_FromLong(long);
extern PyObject *PyBool_FromLong(long);
extern int PyObject_IsTrue(PyObject *);
extern Py_ssize_t PyObject_Hash(PyObject *);
extern int PyObject_IsInstance(PyObject *, PyObject *);
extern int PyObject_IsSubclass(PyObject *, PyObject *);
extern int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
extern void PyBuffer_Release(Py_buffer *);
extern PyObject *PyTuple_New(Py_ssize_t);
extern Py_ssize_t PyTuple_Size(PyObject *);
extern PyObject *PyTuple_GetItem(PyObject *, Py_ssize_t);
extern int PyTuple_SetItem(PyObject *, Py_ssize_t, PyObject *);
extern PyObject *PyImport_ImportModule(const char *);
extern PyObject *PyObject_GetAttrString(PyObject *, const char *);
extern void *PyType_GetSlot(PyObject *, int);
extern PyObject *PyUnicode_FromString(const char *);
extern const char *PyUnicode_AsUTF8AndSize(PyObject *, Py_ssize_t *);
extern PyObject *PyCapsule_New(void *, const char *, void (*)(PyObject *));
extern void *PyCapsule_GetPointer(PyObject *, const char *);
extern PyObject *PyCFunction_NewEx(PyMethodDef *, PyObject *, PyObject *);
extern unsigned long PyThread_get_thread_ident(void);
extern PyObject *PyModule_Create2(PyModuleDef *, int);
extern int PyModule_AddObjectRef(PyObject *, const char *, PyObject *);
extern int PyModule_AddStringConstant(PyObject *, const char *, const char *);
extern void *PyEval_SaveThread(void);
extern void PyEval_RestoreThread(void *);

enum { MOST_SLOTS = $slots, MOST_VIEWS = $views, MOST_NUMBERS = $numbers };

/* Read-only numbers from which on other threads may run meanwhile. */
enum { LONG_CALL = 256 };

typedef struct { double number; double *at; int whole, rows, columns; } slot;

typedef struct {
    const char *name, *takes, *gives, *about;
    int arguments;
    void (*call)(const slot *, double *);
    void (*fits)(const slot *, double *); /* whether the first slots fit together; or NULL */
    int asked; /* slots that it reads */
} entry;

typedef struct {
    const entry *of;
    const char *at; /* in the program of the arguments */
    slot slots[MOST_SLOTS];
    Py_buffer views[MOST_VIEWS];
    int n_slots, n_views;
    int lasting; /* its buffers are its own */
    Py_ssize_t read; /* numbers of arrays that are not written */
} call;

static const struct { const char *module, *name; } classes[] = {$classes};
static PyObject *made[sizeof classes / sizeof *classes];
static newfunc new_tuple;

/* Buffers held of what is the same in every step: records, and arrays that nobody can
 * change. numpy takes 4 µs to describe a record anew. */
enum { HELD = 16 };
static Py_buffer held[HELD];
static int oldest;

/* The buffer of an array, which is held or is to be released; NULL: it is none. */
static const Py_buffer *buffer_of(PyObject *given, Py_buffer *view, int record, int written,
                                  int lasting)
{
    for (int i = 0; i < HELD && !written && !lasting; i++)
        if (held[i].obj == given)
            return &held[i];
    if (PyObject_GetBuffer(given, view, FORMAT | CONTIGUOUS | (written ? WRITABLE : 0))) {
        PyErr_Clear();
        return NULL;
    }
    const int same = record || (view->readonly && view->len < 4096);
    /* Who describes himself within the view cannot be held by a copy of it. */
    if (written || lasting || !same || view->obj != given || view->shape == &view->len)
        return view;
    Py_buffer *place = &held[oldest++ % HELD];
    if (oldest >= HELD)
        oldest = 0;
    if (place->obj)
        PyBuffer_Release(place);
    *place = *view;
    return place;
}

static int refuse(const call *c, PyObject *kind, const char *why)
{
    PyErr_Format(kind, "%s: argument %d: %s", c->of->name, c->n_slots + 1, why);
    return -1;
}

static Py_ssize_t number(const char **at)
{
    Py_ssize_t n = 0;
    while (**at >= '0' && **at <= '9')
        n = 10 * n + (*(*at)++ - '0');
    return n;
}

static int take_array(call *c, PyObject *given, char kind)
{
    const int written = kind == 'V' || kind == 'M' || kind == 'R';
    const int record = kind == 'r' || kind == 'R', wanted = kind == 'm' || kind == 'M' ? 2 : 1;
    slot *s = &c->slots[c->n_slots];
    const Py_buffer *view
        = buffer_of(given, &c->views[c->n_views], record, written, c->lasting);
    if (!view)
        return refuse(c, PyExc_TypeError,
                      written ? "a contiguous array is wanted that can be written"
                              : "a contiguous array is wanted");
    c->n_views += view == &c->views[c->n_views];
    if (view->ndim != wanted)
        return refuse(c, PyExc_ValueError, "an array of as many dimensions is wanted");
    s->at = (double *)view->buf;
    if (record) {
        if (view->itemsize != number(&c->at) || view->shape[0] != 1)
            return refuse(c, PyExc_TypeError, "one record of the right type is wanted");
        c->n_slots++;
        return 0;
    }
    if (view->itemsize != 8 || !view->format || view->format[0] != 'd' || view->format[1])
        return refuse(c, PyExc_TypeError, "an array of float64 is wanted");
    if (view->len / 8 > INT32_MAX || view->shape[0] > INT32_MAX
        || (wanted == 2 && view->shape[1] > INT32_MAX))
        return refuse(c, PyExc_OverflowError, "the array is too large");
    const Py_ssize_t rows = number(&c->at);
    c->at += wanted == 2;
    const Py_ssize_t columns = wanted == 2 ? number(&c->at) : 0;
    if (view->shape[0] < rows || (wanted == 2 && view->shape[1] < columns))
        return refuse(c, PyExc_ValueError, "the array is too small");
    s->rows = (int)view->shape[0];
    s->columns = wanted == 2 ? (int)view->shape[1] : 1;
    if (!written)
        c->read += view->len / 8;
    c->n_slots++;
    return 0;
}

static int take(call *c, PyObject *given)
{
    slot *s = &c->slots[c->n_slots];
    switch (*c->at++) {
    case 'd':
        s->number = PyFloat_AsDouble(given);
        if (s->number == -1.0 && PyErr_Occurred())
            return -1;
        c->n_slots++;
        return 0;
    case 'i': {
        const long long whole = PyLong_AsLongLong(given);
        if (whole == -1 && PyErr_Occurred())
            return -1;
        if (whole < INT32_MIN || whole > INT32_MAX)
            return refuse(c, PyExc_OverflowError, "the integer is too large");
        s->whole = (int)whole;
        c->n_slots++;
        return 0;
    }
    case 'b':
        s->whole = PyObject_IsTrue(given);
        if (s->whole < 0)
            return -1;
        c->n_slots++;
        return 0;
    case '(': {
        const Py_ssize_t size = PyTuple_Size(given);
        Py_ssize_t i = 0;
        if (size < 0) {
            PyErr_Clear();
            return refuse(c, PyExc_TypeError, "a tuple is wanted");
        }
        for (; *c->at != ')'; i++) {
            if (i >= size)
                return refuse(c, PyExc_TypeError, "a tuple of more parts is wanted");
            if (take(c, PyTuple_GetItem(given, i)))
                return -1;
        }
        c->at++;
        if (i != size)
            return refuse(c, PyExc_TypeError, "a tuple of fewer parts is wanted");
        return 0;
    }
    default:
        return take_array(c, given, c->at[-1]);
    }
}

static PyObject *class_of(int number)
{
    if (!made[number]) {
        PyObject *module = PyImport_ImportModule(classes[number].module);
        if (!module)
            return NULL;
        made[number] = PyObject_GetAttrString(module, classes[number].name);
        Py_DecRef(module);
    }
    return made[number];
}

/* What a tuple, which is used up, is as one of a class of tuples. */
static PyObject *as_named(PyObject *of, PyObject *tuple)
{
    PyObject *one = of ? PyTuple_New(1) : NULL, *named = NULL;
    if (one) {
        PyTuple_SetItem(one, 0, tuple);
        named = new_tuple(of, one, NULL);
        Py_DecRef(one);
    } else
        Py_DecRef(tuple);
    return named;
}

static PyObject *give(const char **at, const double **numbers)
{
    int number = -1;
    Py_ssize_t size = 0;
    const char *kind = (*at)++;
    switch (*kind) {
    case 'd':
        return PyFloat_FromDouble(*(*numbers)++);
    case 'i':
        return PyLong_FromLong((long)*(*numbers)++);
    case 'b':
        return PyBool_FromLong(*(*numbers)++ != 0.0);
    case 'n':
        Py_IncRef(&_Py_NoneStruct);
        return &_Py_NoneStruct;
    }
    if (*kind == '<') {
        number = 10 * ((*at)[0] - '0') + (*at)[1] - '0';
        *at += 2;
    }
    int deep = 0;
    for (const char *c = *at; deep > 0 || (*c != ')' && *c != '>'); c++) {
        size += deep == 0;
        deep += (*c == '(' || *c == '<') - (*c == ')' || *c == '>');
        if (*c == '<')
            c += 2;
    }
    PyObject *tuple = PyTuple_New(size);
    for (Py_ssize_t i = 0; tuple && i < size; i++) {
        PyObject *part = give(at, numbers);
        if (!part || PyTuple_SetItem(tuple, i, part)) {
            Py_DecRef(tuple);
            return NULL;
        }
    }
    (*at)++;
    return tuple && number >= 0 ? as_named(class_of(number), tuple) : tuple;
}

static void enter(const entry *of, const slot *slots, Py_ssize_t read, double *result)
{
    if (read >= LONG_CALL) {
        void *thread = PyEval_SaveThread();
        of->call(slots, result);
        PyEval_RestoreThread(thread);
    } else
        of->call(slots, result);
}

static int unfit(const call *c)
{
    double fits = 1.0;
    if (c->of->fits)
        c->of->fits(c->slots, &fits);
    if (fits == 0.0)
        PyErr_Format(PyExc_ValueError, "%s: the arguments do not fit together", c->of->name);
    return fits == 0.0;
}

static PyObject *run(const entry *of, PyObject *const *given, Py_ssize_t count)
{
    call c;
    double result[MOST_NUMBERS];
    PyObject *answer = NULL;
    c.of = of, c.at = of->takes, c.n_slots = c.n_views = c.lasting = 0, c.read = 0;
    if (count != of->arguments)
        return PyErr_Format(PyExc_TypeError, "%s takes %d arguments, not %zd", of->name,
                            of->arguments, count);
    for (Py_ssize_t i = 0; i < count; i++)
        if (take(&c, given[i]))
            goto end;
    if (unfit(&c))
        goto end;
    enter(of, c.slots, c.read, result);
    const char *gives = of->gives;
    const double *numbers = result;
    answer = give(&gives, &numbers);
end:
    for (int i = 0; i < c.n_views; i++)
        PyBuffer_Release(&c.views[i]);
    return answer;
}

$calls

static const entry entries[] = {
$entries
};
enum { ENTRIES = sizeof entries / sizeof *entries };

static PyObject *call_entry(PyObject *self, PyObject *const *a, Py_ssize_t n)
{
    const entry *of = PyCapsule_GetPointer(self, NULL);
    return of ? run(of, a, n) : NULL;
}

/* A filter's call, of which most is the same every time: that is taken apart once, and
 * its buffers are held as long as the call lives. What comes with each call has to be
 * just what is expected: floats, an array of numpy, and for all else the very objects
 * that stand for nothing. Where it is not, in another thread, and where the machine code
 * wants more memory or finds something invalid, the answer is None: Python then takes the
 * long way, and says what is wrong. */

enum { MOST_GIVEN = 16, FIELDS = 11 }; /* of a Decision */
enum { r_code, r_v, r_omega, r_clearance, r_slack, r_residual, r_shortfall, r_first, r_second };

typedef struct {
    call known;
    struct {
        PyObject *same; /* what has to be given; NULL: what fills a slot */
        int slot;
    } given[MOST_GIVEN];
    int count, rows; /* which of them is the array */
    unsigned long thread;
    PyObject *kept, *array, *decision, *statuses; /* borrowed of the first, but it */
    PyObject *zero, *none_active, *no_text;  /* 0.0, () and "" */
    PyObject *float64; /* the type of numbers of an array that is read as it lies, or NULL */
    allocfunc new_decision;
} bound_call;

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int are_bits(double x, double y)
{
    return !memcmp(&x, &y, sizeof x);
}

/* A float, for which one of a number of the same bits may stand. */
static PyObject *as_float(double x, PyObject *same, double number)
{
    if (!are_bits(x, number))
        return PyFloat_FromDouble(x);
    Py_IncRef(same);
    return same;
}

/* The twist's number that was desired, if it is to be driven. */
static PyObject *as_driven(const bound_call *b, double x, PyObject *const *given, int i)
{
    if (b->given[i].same)
        return PyFloat_FromDouble(x);
    return as_float(x, given[i], b->known.slots[b->given[i].slot].number);
}

static PyObject *as_active(const bound_call *b, int first, int second)
{
    const int owners[2] = {first >= 0 ? first : second, second};
    const int many = (first >= 0) + (second >= 0 && second != first);
    if (!many)
        Py_IncRef(b->none_active);
    PyObject *active = many ? PyTuple_New(many) : b->none_active;
    for (int i = 0; active && i < many; i++) {
        PyObject *obstacle = PyLong_FromLong(owners[i]);
        if (!obstacle || PyTuple_SetItem(active, i, obstacle)) {
            Py_DecRef(active);
            return NULL;
        }
    }
    return active;
}

/* A Decision of fields that have all been made; they are used up. It is filled before any
 * other code may run, so that nobody meets half a one. */
static PyObject *made_of(const bound_call *b, PyObject *const *parts)
{
    PyObject *made = b->new_decision ? b->new_decision(b->decision, FIELDS) : PyTuple_New(FIELDS);
    for (Py_ssize_t i = 0; i < FIELDS; i++)
        if (made)
            PyTuple_SetItem(made, i, parts[i]);
        else
            Py_DecRef(parts[i]);
    return made && !b->new_decision ? as_named(b->decision, made) : made;
}

/* The decision that an outcome is, its fields in their order. */
static PyObject *as_decision(bound_call *b, const double *r, PyObject *const *given, double began)
{
    PyObject *status = PyTuple_GetItem(b->statuses, (Py_ssize_t)r[r_code]);
    if (!status)
        return NULL;
    Py_IncRef(status), Py_IncRef(b->zero), Py_IncRef(b->no_text);
    PyObject *parts[FIELDS] = {as_driven(b, r[r_v], given, 0),
                               as_driven(b, r[r_omega], given, 1),
                               status,
                               PyFloat_FromDouble(r[r_clearance]),
                               as_float(r[r_slack], b->zero, 0.0),
                               as_float(r[r_residual], b->zero, 0.0),
                               as_active(b, (int)r[r_first], (int)r[r_second]),
                               PyFloat_FromDouble(seconds() - began),
                               as_float(r[r_shortfall], b->zero, 0.0),
                               b->zero,
                               b->no_text};
    int whole = 1;
    for (Py_ssize_t i = 0; i < FIELDS; i++)
        whole = whole && parts[i];
    if (whole)
        return made_of(b, parts);
    for (Py_ssize_t i = 0; i < FIELDS; i++)
        if (parts[i])
            Py_DecRef(parts[i]);
    return NULL;
}

/* What an array of numpy begins with, in all versions so far: bind looks whether it does. */
typedef struct {
    PyObject head;
    char *data;
    int ndim;
    Py_ssize_t *shape, *strides;
    PyObject *base, *type;
    int flags;
} array;
enum { c_order = 0x1, fortran_order = 0x2, aligned = 0x100 };

/* Whether an array (2, 3) of float64, and its transpose, lie as numpy says. */
static int lies_so(PyObject *given, PyObject *type, int rows, int order)
{
    const array *a = (const array *)given;
    Py_buffer view;
    if (PyObject_GetBuffer(given, &view, FORMAT | STRIDED))
        return 0;
    const int so = view.format && view.format[0] == 'd' && !view.format[1] && view.ndim == 2 && view.shape[0] == rows && view.shape[1] == 5 - rows
                   && a->data == view.buf && a->ndim == 2 && a->shape[0] == rows
                   && a->shape[1] == 5 - rows && a->strides[0] == view.strides[0]
                   && a->strides[1] == view.strides[1] && a->type == type
                   && (a->flags & (c_order | fortran_order | aligned)) == (order | aligned);
    PyBuffer_Release(&view);
    return so;
}

/* The type of numbers of such an array, if its transpose lies so, too; else NULL. */
static PyObject *type_read(const bound_call *b, PyObject *probe)
{
    PyObject *type = PyObject_GetAttrString(probe, "dtype");
    PyObject *turned = PyObject_GetAttrString(probe, "T");
    const int so = type && turned && probe->type == b->array && turned->type == b->array
                   && lies_so(probe, type, 2, c_order)
                   && lies_so(turned, type, 3, fortran_order);
    if (turned)
        Py_DecRef(turned);
    if (type && !so)
        Py_DecRef(type);
    PyErr_Clear();
    return so ? type : NULL;
}

/* An array of numpy's own, of float64 in rows of so many, one after another. It is read as
 * it lies where nobody else can run meanwhile: to ask numpy for a buffer takes as long as
 * half of the mathematics. */
static int take_rows(const bound_call *b, PyObject *given, int columns, slot *s, Py_buffer *view)
{
    const array *a = (const array *)given;
    view->obj = NULL;
    if (given->type != b->array)
        return -1;
    if (b->float64 && a->type == b->float64 && a->ndim == 2 && a->shape[1] == columns
        && (a->flags & c_order) && a->shape[0] < (LONG_CALL - b->known.read) / columns
        && (uintptr_t)a->data % sizeof(double) == 0) {
        s->at = (double *)a->data;
        s->rows = (int)a->shape[0];
        return 0;
    }
    if (PyObject_GetBuffer(given, view, FORMAT | CONTIGUOUS)) {
        PyErr_Clear();
        return -1;
    }
    if (view->ndim == 2 && view->shape[1] == columns && view->shape[0] <= INT32_MAX / columns
        && view->itemsize == 8 && view->format && view->format[0] == 'd' && !view->format[1]
        && (uintptr_t)view->buf % sizeof(double) == 0) {
        s->at = (double *)view->buf;
        s->rows = (int)view->shape[0];
        return 0;
    }
    PyBuffer_Release(view);
    return -1;
}

/* Take what is given, and the buffer of its array. */
static int take_given(bound_call *b, PyObject *const *a, Py_buffer *view)
{
    for (int i = 0; i < b->count; i++) {
        PyObject *same = b->given[i].same;
        if (i == b->rows || a[i] == same)
            continue;
        if (a[i]->type != &PyFloat_Type)
            return -1;
        const double number = PyFloat_AsDouble(a[i]);
        if (!same)
            b->known.slots[b->given[i].slot].number = number;
        else if (same->type != &PyFloat_Type || !are_bits(number, PyFloat_AsDouble(same)))
            return -1;
    }
    slot *s = &b->known.slots[b->given[b->rows].slot];
    return take_rows(b, a[b->rows], s->columns, s, view);
}

static PyObject *call_bound(PyObject *self, PyObject *const *a, Py_ssize_t n)
{
    bound_call *b = PyCapsule_GetPointer(self, NULL);
    PyObject *answer = &_Py_NoneStruct;
    Py_buffer view;
    double result[MOST_NUMBERS];
    if (!b)
        return NULL;
    if (n == b->count && PyThread_get_thread_ident() == b->thread) {
        const double began = seconds();
        if (!take_given(b, a, &view)) {
            const slot *s = &b->known.slots[b->given[b->rows].slot];
            const Py_ssize_t read = b->known.read + (Py_ssize_t)s->rows * s->columns;
            enter(b->known.of, b->known.slots, read, result);
            if (view.obj)
                PyBuffer_Release(&view);
            if (result[r_code] >= 0.0)
                return as_decision(b, result, a, began);
        }
    }
    Py_IncRef(answer);
    return answer;
}

static PyMethodDef bound_method = {"bound", call_bound, METH_FASTCALL, "See bind."};

static void unbind(PyObject *capsule)
{
    bound_call *b = PyCapsule_GetPointer(capsule, NULL);
    for (int i = 0; i < b->known.n_views; i++)
        PyBuffer_Release(&b->known.views[i]);
    Py_DecRef(b->zero);
    Py_DecRef(b->none_active);
    Py_DecRef(b->no_text);
    Py_DecRef(b->float64);
    Py_DecRef(b->kept);
    free(b);
}

/* Take what is known: an entry's arguments, one after another. */
static int take_known(bound_call *b, PyObject *known, int *slots)
{
    if (PyTuple_Size(known) != b->known.of->arguments)
        return refuse(&b->known, PyExc_TypeError, "all arguments are wanted");
    for (int i = 0; i < b->known.of->arguments; i++) {
        slots[i] = b->known.n_slots;
        if (take(&b->known, PyTuple_GetItem(known, i)))
            return -1;
    }
    return unfit(&b->known) ? -1 : 0;
}

/* Take note of what comes with each call: the number of the argument that it fills, v and
 * ω first, or what is given in place of nothing. */
static int take_pattern(bound_call *b, PyObject *given, const int *slots)
{
    b->count = (int)PyTuple_Size(given), b->rows = -1;
    if (b->count < 2 || b->count > MOST_GIVEN)
        return refuse(&b->known, PyExc_TypeError, "too little or too much is given");
    for (int i = 0; i < b->count; i++) {
        PyObject *one = PyTuple_GetItem(given, i);
        const long long number = one->type == &PyLong_Type ? PyLong_AsLongLong(one) : -1;
        if (number >= 0 && number < b->known.of->arguments) {
            if (slots[number] < b->known.of->asked)
                return refuse(&b->known, PyExc_TypeError, "what is asked for is to be known");
            b->given[i].slot = slots[number];
            if (b->known.slots[slots[number]].columns)
                b->rows = i;
        } else
            b->given[i].same = one;
    }
    return b->rows < 2 ? refuse(&b->known, PyExc_TypeError, "no array is given") : 0;
}

/* Whether a Decision in one piece of memory has the hash of the tuple that it is. Python
 * 3.14 keeps a tuple's hash within it, which has to be set up: then it goes the long way. */
static int has_its_hash(const bound_call *b)
{
    PyObject *parts[FIELDS], *tuple = PyTuple_New(FIELDS);
    for (Py_ssize_t i = 0; i < FIELDS; i++) {
        Py_IncRef(&_Py_NoneStruct), parts[i] = &_Py_NoneStruct;
        Py_IncRef(&_Py_NoneStruct);
        if (!tuple || PyTuple_SetItem(tuple, i, &_Py_NoneStruct))
            Py_DecRef(&_Py_NoneStruct);
    }
    PyObject *made = made_of(b, parts);
    const int has = made && tuple && PyObject_Hash(made) == PyObject_Hash(tuple);
    if (made)
        Py_DecRef(made);
    if (tuple)
        Py_DecRef(tuple);
    PyErr_Clear();
    return has;
}

static PyObject *as_bound(bound_call *b, PyObject *probe, PyObject *capsule)
{
    b->float64 = type_read(b, probe);
    b->new_decision = (allocfunc)PyType_GetSlot(b->decision, TP_ALLOC);
    if (!has_its_hash(b))
        b->new_decision = NULL;
    return PyCFunction_NewEx(&bound_method, capsule, NULL);
}

/* bind(name, arguments, given, (ndarray, Decision, statuses, array of (2, 3))): the call of
 * an entry of which the arguments are known but for those that are given. */
static PyObject *bind(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    const char *name = n == 4 ? PyUnicode_AsUTF8AndSize(a[0], NULL) : NULL;
    const entry *of = NULL;
    for (int i = 0; name && i < ENTRIES; i++)
        if (!strcmp(entries[i].name, name))
            of = &entries[i];
    bound_call *b = of ? calloc(1, sizeof *b) : NULL;
    PyObject *capsule = b ? PyCapsule_New(b, NULL, unbind) : NULL, *bound = NULL;
    int slots[MOST_SLOTS];
    if (!capsule) {
        free(b);
        return PyErr_Format(PyExc_TypeError, "bind: an entry and three tuples are wanted");
    }
    b->known.of = of, b->known.at = of->takes, b->known.lasting = 1;
    b->thread = PyThread_get_thread_ident();
    b->kept = PyTuple_New(3), b->none_active = PyTuple_New(0);
    b->zero = PyFloat_FromDouble(0.0), b->no_text = PyUnicode_FromString("");
    for (int i = 0; b->kept && i < 3; i++) {
        Py_IncRef(a[i + 1]);
        PyTuple_SetItem(b->kept, i, a[i + 1]);
    }
    if (b->kept && b->none_active && b->zero && b->no_text) {
        b->array = PyTuple_GetItem(a[3], 0), b->decision = PyTuple_GetItem(a[3], 1);
        b->statuses = PyTuple_GetItem(a[3], 2);
        PyObject *probe = PyTuple_GetItem(a[3], 3);
        if (!probe || PyObject_IsInstance(b->decision, &PyType_Type) != 1
            || PyObject_IsSubclass(b->decision, &PyTuple_Type) != 1)
            refuse(&b->known, PyExc_TypeError, "a type, a class of tuples, a tuple and an array are wanted");
        else if (!take_known(b, a[1], slots) && !take_pattern(b, a[2], slots))
            bound = as_bound(b, probe, capsule);
    }
    Py_DecRef(capsule);
    return bound;
}

static PyMethodDef of_entries[ENTRIES], methods[] = {
    {"bind", bind, METH_FASTCALL, "Return the call of an entry of which most is known."},
    {NULL, NULL, 0, NULL}};

static PyModuleDef module = {
    1, NULL, NULL, 0, NULL, "_native", "Machine code of qpavoid.", -1, methods, NULL, NULL,
    NULL, NULL};

#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
PyObject *PyInit__native(void);

PyObject *PyInit__native(void)
{
    PyObject *native = PyModule_Create2(&module, ABI);
    new_tuple = (newfunc)PyType_GetSlot(&PyTuple_Type, TP_NEW);
    if (native && PyModule_AddStringConstant(native, "STAMPS", $stamps))
        return NULL;
    for (int i = 0; native && i < ENTRIES; i++) {
        const PyMethodDef made = {entries[i].name, call_entry, METH_FASTCALL, entries[i].about};
        of_entries[i] = made;
        PyObject *self = PyCapsule_New((void *)&entries[i], NULL, NULL);
        PyObject *function = self ? PyCFunction_NewEx(&of_entries[i], self, NULL) : NULL;
        if (!function || PyModule_AddObjectRef(native, made.name, function))
            return NULL;
        Py_DecRef(self), Py_DecRef(function);
    }
    return native;
}
