/* The door from Python: arrays by the buffer protocol. */
#ifndef PLUMBOB_DOOR_H
#define PLUMBOB_DOOR_H

#include <setjmp.h>

typedef struct { Py_buffer views[64]; int open; } Held;

/* Where to go from a kernel that meets an index outside an array: nothing in a kernel holds memory. */
typedef struct { jmp_buf back; int64_t i, n; } Way_out;
extern __thread Way_out *way_out __attribute__((visibility("hidden")));

static PyObject *is_outside(const char *kernel, const Way_out *met) {
    return PyErr_Format(PyExc_IndexError, "%s: index %lld is outside an axis of %lld numbers", kernel,
                        (long long)met->i, (long long)met->n);
}

static void let_go(Held *held) {
    while (held->open) PyBuffer_Release(&held->views[--held->open]);
}

static int is_kind(const Py_buffer *view, const char *kinds, size_t size) {
    const char *format = view->format ? view->format : "B";
    if (*format == '@' || *format == '=' || *format == '<') format++;
    return (size_t)view->itemsize == size && format[0] && !format[1] && strchr(kinds, format[0]);
}

/* The numbers of an array that stand one behind the other, and how many there are along each axis. */
static int take(PyObject *given, Held *held, const char *kernel, const char *name, const char *kinds, size_t size,
                int axes, int written, void *first, int64_t *n) {
    Py_buffer *view = &held->views[held->open];
    int flags = PyBUF_FORMAT | PyBUF_C_CONTIGUOUS | (written ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(given, view, flags)) return 0;
    held->open++;
    if (view->ndim != axes || !is_kind(view, kinds, size)) {
        PyErr_Format(PyExc_TypeError, "%s: %s is an array of %d axes and kind %s, not of %d axes and kind %s", kernel,
                     name, axes, kinds, view->ndim, view->format ? view->format : "B");
        return 0;
    }
    memcpy(first, &view->buf, sizeof view->buf);
    for (int axis = 0; axis < axes; axis++) n[axis] = view->shape[axis];
    return 1;
}

static int take_double(PyObject *given, double *value) {
    *value = PyFloat_AsDouble(given);
    return !(*value == -1.0 && PyErr_Occurred());
}

static int take_int64_t(PyObject *given, int64_t *value) {
    PyObject *integer = PyNumber_Index(given);
    if (!integer) return 0;
    *value = PyLong_AsLongLong(integer);
    Py_DecRef(integer);
    return !(*value == -1 && PyErr_Occurred());
}

static int take_bool(PyObject *given, bool *value) {
    int answer = PyObject_IsTrue(given);
    *value = answer > 0;
    return answer >= 0;
}

static int are(const char *kernel, Py_ssize_t wanted, Py_ssize_t count) {
    if (count == wanted) return 1;
    PyErr_Format(PyExc_TypeError, "%s takes %zd arguments, not %zd", kernel, wanted, count);
    return 0;
}

static PyObject *part_of(PyObject *given, Py_ssize_t at, Py_ssize_t size, const char *kernel) {
    if (PyTuple_Size(given) != size) {
        PyErr_Clear();
        PyErr_Format(PyExc_TypeError, "%s takes a tuple of %zd here", kernel, size);
        return NULL;
    }
    return PyTuple_GetItem(given, at);
}
#endif
