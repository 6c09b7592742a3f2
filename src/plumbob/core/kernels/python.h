/* What the door needs of Python's stable interface since 3.11 [PEP 384], so that no headers of Python are needed. */
#ifndef PLUMBOB_PYTHON_H
#define PLUMBOB_PYTHON_H
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define FROM_PYTHON extern __declspec(dllimport)
#define TO_PYTHON __declspec(dllexport)
#else
#define FROM_PYTHON extern
#define TO_PYTHON __attribute__((visibility("default")))
#endif

typedef intptr_t Py_ssize_t;
typedef struct _object { Py_ssize_t references; void *type; } PyObject;
typedef PyObject *(*PyCFunction)(PyObject *, PyObject *);
typedef struct { const char *name; PyCFunction function; int flags; const char *doc; } PyMethodDef;
typedef struct { int slot; void *value; } PyModuleDef_Slot;
typedef struct {
    PyObject base; void *init; Py_ssize_t index; PyObject *copy;
    const char *name, *doc; Py_ssize_t size; PyMethodDef *methods; PyModuleDef_Slot *slots;
    void *traverse, *clear, *free;
} PyModuleDef;
typedef struct {
    void *buf; PyObject *obj; Py_ssize_t len, itemsize; int readonly, ndim;
    char *format; Py_ssize_t *shape, *strides, *suboffsets; void *internal;
} Py_buffer;
enum { METH_FASTCALL = 0x80, Py_mod_exec = 2, PyBUF_WRITABLE = 1, PyBUF_FORMAT = 4, PyBUF_C_CONTIGUOUS = 0x38 };

FROM_PYTHON PyObject _Py_NoneStruct, *PyExc_TypeError, *PyExc_IndexError;
FROM_PYTHON void Py_IncRef(PyObject *);
FROM_PYTHON void Py_DecRef(PyObject *);
FROM_PYTHON void *PyEval_SaveThread(void);
FROM_PYTHON void PyEval_RestoreThread(void *);
FROM_PYTHON PyObject *PyErr_Occurred(void);
FROM_PYTHON void PyErr_Clear(void);
FROM_PYTHON PyObject *PyErr_Format(PyObject *, const char *, ...);
FROM_PYTHON int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
FROM_PYTHON void PyBuffer_Release(Py_buffer *);
FROM_PYTHON int PyObject_IsTrue(PyObject *);
FROM_PYTHON PyObject *PyNumber_Index(PyObject *);
FROM_PYTHON long long PyLong_AsLongLong(PyObject *);
FROM_PYTHON PyObject *PyLong_FromLongLong(long long);
FROM_PYTHON double PyFloat_AsDouble(PyObject *);
FROM_PYTHON PyObject *PyFloat_FromDouble(double);
FROM_PYTHON PyObject *PyBool_FromLong(long);
FROM_PYTHON Py_ssize_t PyTuple_Size(PyObject *);
FROM_PYTHON PyObject *PyTuple_GetItem(PyObject *, Py_ssize_t);
FROM_PYTHON PyObject *Py_BuildValue(const char *, ...);
FROM_PYTHON PyObject *PyModuleDef_Init(PyModuleDef *);
FROM_PYTHON int PyModule_AddFunctions(PyObject *, PyMethodDef *);
#endif
