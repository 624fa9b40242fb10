
/* What follows is the border to Python: arguments are checked and taken apart by the
 * program of their entry, a character a leaf, and results are put together.
 *
 *   d i b    a double, an int, a bool          n      None
 *   v V m M  a vector or a matrix, written     r R    a record, written
 *   ( )      a tuple                           < >    a named tuple, its number before
 *
 * The stable ABI of Python 3.11 is declared here, so that no headers need be there. */

typedef struct _object PyObject;
typedef intptr_t Py_ssize_t;
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
enum { METH_FASTCALL = 0x80, ABI = 3 };
enum { WRITABLE = 0x1, FORMAT = 0x4, CONTIGUOUS = 0x38 };

extern PyObject *PyExc_TypeError, *PyExc_ValueError, *PyExc_OverflowError, _Py_NoneStruct;
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
extern int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
extern void PyBuffer_Release(Py_buffer *);
extern PyObject *PyTuple_New(Py_ssize_t);
extern Py_ssize_t PyTuple_Size(PyObject *);
extern PyObject *PyTuple_GetItem(PyObject *, Py_ssize_t);
extern int PyTuple_SetItem(PyObject *, Py_ssize_t, PyObject *);
extern PyObject *PyImport_ImportModule(const char *);
extern PyObject *PyObject_GetAttrString(PyObject *, const char *);
extern PyObject *PyObject_CallFunctionObjArgs(PyObject *, ...);
extern PyObject *PyModule_Create2(PyModuleDef *, int);
extern int PyModule_AddStringConstant(PyObject *, const char *, const char *);
extern void *PyEval_SaveThread(void);
extern void PyEval_RestoreThread(void *);

enum { MOST_SLOTS = 128, MOST_VIEWS = 24, MOST_NUMBERS = 128 };

/* Read-only numbers from which on other threads may run meanwhile. */
enum { LONG_CALL = 256 };

typedef struct { double number; double *at; int whole, rows, columns; } slot;

typedef struct {
    const char *name, *takes, *gives;
    int arguments;
    void (*call)(const slot *, double *);
} entry;

typedef struct {
    const entry *of;
    const char *at; /* in the program of the arguments */
    slot slots[MOST_SLOTS];
    Py_buffer views[MOST_VIEWS];
    int n_slots, n_views;
    Py_ssize_t read; /* numbers of arrays that are not written */
} call;

static const struct { const char *module, *name; } classes[] = {$classes};
static PyObject *made[sizeof classes / sizeof *classes];
static PyObject *new_tuple;

/* Buffers held of what is the same in every step: records, and arrays that nobody can
 * change. numpy takes 4 µs to describe a record anew. */
enum { HELD = 16 };
static Py_buffer held[HELD];
static int oldest;

/* The buffer of an array, which is held or is to be released; NULL: it is none. */
static const Py_buffer *buffer_of(PyObject *given, Py_buffer *view, int record, int written)
{
    for (int i = 0; i < HELD && !written; i++)
        if (held[i].obj == given)
            return &held[i];
    if (PyObject_GetBuffer(given, view, FORMAT | CONTIGUOUS | (written ? WRITABLE : 0))) {
        PyErr_Clear();
        return NULL;
    }
    const int same = record || (view->readonly && view->len < 4096);
    /* Who describes himself within the view cannot be held by a copy of it. */
    if (written || !same || view->obj != given || view->shape == &view->len)
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

static int take_array(call *c, PyObject *given, char kind)
{
    const int written = kind == 'V' || kind == 'M' || kind == 'R';
    const int record = kind == 'r' || kind == 'R', wanted = kind == 'm' || kind == 'M' ? 2 : 1;
    slot *s = &c->slots[c->n_slots];
    const Py_buffer *view = buffer_of(given, &c->views[c->n_views], record, written);
    if (!view)
        return refuse(c, PyExc_TypeError,
                      written ? "a contiguous array is wanted that can be written"
                              : "a contiguous array is wanted");
    c->n_views += view == &c->views[c->n_views];
    if (view->ndim != wanted)
        return refuse(c, PyExc_ValueError, "an array of as many dimensions is wanted");
    s->at = (double *)view->buf;
    if (record) {
        const char *end = c->at; /* the size in bytes follows */
        int size = 0;
        while (*end >= '0' && *end <= '9')
            size = 10 * size + (*end++ - '0');
        c->at = end;
        if (view->itemsize != size || view->shape[0] != 1)
            return refuse(c, PyExc_TypeError, "one record of the right type is wanted");
        c->n_slots++;
        return 0;
    }
    if (view->itemsize != 8 || !view->format || view->format[0] != 'd' || view->format[1])
        return refuse(c, PyExc_TypeError, "an array of float64 is wanted");
    if (view->len / 8 > INT32_MAX || view->shape[0] > INT32_MAX
        || (wanted == 2 && view->shape[1] > INT32_MAX))
        return refuse(c, PyExc_OverflowError, "the array is too large");
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
    if (!tuple || number < 0)
        return tuple;
    PyObject *of = class_of(number), *named = NULL;
    if (of)
        named = PyObject_CallFunctionObjArgs(new_tuple, of, tuple, NULL);
    Py_DecRef(tuple);
    return named;
}

static PyObject *run(const entry *of, PyObject *const *given, Py_ssize_t count)
{
    call c;
    double result[MOST_NUMBERS];
    PyObject *answer = NULL;
    c.of = of, c.at = of->takes, c.n_slots = c.n_views = 0, c.read = 0;
    if (count != of->arguments)
        return PyErr_Format(PyExc_TypeError, "%s takes %d arguments, not %zd", of->name,
                            of->arguments, count);
    for (Py_ssize_t i = 0; i < count; i++)
        if (take(&c, given[i]))
            goto end;
    if (c.read >= LONG_CALL) {
        void *thread = PyEval_SaveThread();
        of->call(c.slots, result);
        PyEval_RestoreThread(thread);
    } else
        of->call(c.slots, result);
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

$functions

static PyMethodDef methods[] = {
$methods
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
    PyObject *types = PyImport_ImportModule("builtins"), *tuple = NULL, *native = NULL;
    if (types && (tuple = PyObject_GetAttrString(types, "tuple")))
        new_tuple = PyObject_GetAttrString(tuple, "__new__");
    if (new_tuple)
        native = PyModule_Create2(&module, ABI);
    if (native && PyModule_AddStringConstant(native, "STAMPS", $stamps))
        return NULL;
    return native;
}
