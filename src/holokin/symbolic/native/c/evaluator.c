/* A Python callable (arguments) -> new arrays around hk_sample of a library. Where an argument does not fit, or what is
   found is not sound, another callable, written in Python, is called with the same arguments: it converts, or raises. */
#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <Python.h>
#include <numpy/arrayobject.h>
#include <stddef.h>
#include <string.h>
#include <structmember.h>

enum { HK_MOST = 8, HK_ROOM = 128 }; /* arguments, and results; numbers of lists and of arrays that are not in rows */

typedef int (*hk_sample_t)(const double *const *in, double *const *out, const double *context);

typedef struct {
  int dims; /* 0 for a float */
  npy_intp size, dim[3];
} hk_shape;

typedef struct {
  PyObject_HEAD
  vectorcallfunc call;
  hk_sample_t sample;
  const double *context; /* what `sample` reads besides */
  int inputs, results;
  hk_shape in[HK_MOST], out[HK_MOST];
  PyObject *other; /* the callable for all else */
  PyObject *kept;  /* what the address of `sample` belongs to */
} hk_evaluator;

/* The numbers of an argument one row after another: its own, or in `room`, of which `used` are taken. NULL: no fit. */
static const double *hk_numbers(PyObject *given, const hk_shape *wanted, double *room, npy_intp *used) {
  double *copy = room + *used;
  const int fits = wanted->size <= HK_ROOM - *used;
  if (PyArray_CheckExact(given)) {
    PyArrayObject *array = (PyArrayObject *)given;
    if (PyArray_TYPE(array) != NPY_DOUBLE || PyArray_NDIM(array) != wanted->dims || !PyArray_ISNOTSWAPPED(array))
      return NULL;
    for (int d = 0; d < wanted->dims; d++)
      if (PyArray_DIM(array, d) != wanted->dim[d]) return NULL;
    if (PyArray_ISCARRAY_RO(array)) return (const double *)PyArray_DATA(array);
    if (!fits || wanted->dims > 2) return NULL;
    const npy_intp columns = wanted->dims == 2 ? wanted->dim[1] : 1, rows = columns ? wanted->size / columns : 0;
    for (npy_intp i = 0; i < rows; i++)
      for (npy_intp j = 0; j < columns; j++) {
        const char *from = PyArray_BYTES(array) + i * PyArray_STRIDE(array, 0);
        memcpy(copy + i * columns + j, wanted->dims == 2 ? from + j * PyArray_STRIDE(array, 1) : from, sizeof(double));
      }
    *used += wanted->size;
    return copy;
  }
  if (wanted->dims != 1 || !fits) return NULL;
  const int is_list = PyList_CheckExact(given);
  if (!is_list && !PyTuple_CheckExact(given)) return NULL;
  if ((is_list ? PyList_GET_SIZE(given) : PyTuple_GET_SIZE(given)) != wanted->size) return NULL;
  for (npy_intp i = 0; i < wanted->size; i++) {
    PyObject *item = is_list ? PyList_GET_ITEM(given, i) : PyTuple_GET_ITEM(given, i);
    if (PyFloat_Check(item))
      copy[i] = PyFloat_AS_DOUBLE(item);
    else if (PyLong_CheckExact(item)) {
      copy[i] = PyLong_AsDouble(item);
      if (copy[i] == -1.0 && PyErr_Occurred()) {
        PyErr_Clear();
        return NULL;
      }
    } else
      return NULL;
  }
  *used += wanted->size;
  return copy;
}

/* New objects of the numbers that `hk_sample` has written: one, or a tuple of several. Takes the references. */
static PyObject *hk_wrapped(const hk_evaluator *e, PyObject **made, const double *single) {
  PyObject *all = e->results == 1 ? NULL : PyTuple_New(e->results);
  int failed = e->results != 1 && !all;
  for (int b = 0; b < e->results; b++) {
    if (!made[b] && !failed) failed = !(made[b] = PyFloat_FromDouble(single[b]));
    if (failed) {
      Py_CLEAR(made[b]);
    } else if (all) {
      PyTuple_SET_ITEM(all, b, made[b]);
    }
  }
  if (!failed) return all ? all : made[0];
  Py_XDECREF(all);
  return NULL;
}

static PyObject *hk_call_other(const hk_evaluator *e, PyObject *const *args, size_t flagged, PyObject *names) {
  if (e->other) return PyObject_Vectorcall(e->other, args, flagged, names);
  PyErr_SetString(PyExc_RuntimeError, "the function is being destroyed");
  return NULL;
}

static PyObject *hk_call(PyObject *self, PyObject *const *args, size_t flagged, PyObject *names) {
  const hk_evaluator *e = (const hk_evaluator *)self;
  double room[HK_ROOM], single[HK_MOST], *out[HK_MOST];
  const double *in[HK_MOST];
  PyObject *made[HK_MOST] = {NULL};
  npy_intp used = 0;
  int fits = !names && PyVectorcall_NARGS(flagged) == e->inputs;
  for (int a = 0; fits && a < e->inputs; a++) fits = (in[a] = hk_numbers(args[a], &e->in[a], room, &used)) != NULL;
  if (!fits) return hk_call_other(e, args, flagged, names);
  for (int b = 0; b < e->results; b++) {
    out[b] = single + b;
    if (!e->out[b].dims) continue;
    made[b] = PyArray_SimpleNew(e->out[b].dims, (npy_intp *)e->out[b].dim, NPY_DOUBLE);
    if (!made[b]) {
      while (b--) Py_XDECREF(made[b]);
      return NULL;
    }
    out[b] = (double *)PyArray_DATA((PyArrayObject *)made[b]);
  }
  if (e->sample(in, out, e->context)) return hk_wrapped(e, made, single);
  for (int b = 0; b < e->results; b++) Py_XDECREF(made[b]);
  return hk_call_other(e, args, flagged, names);
}

/* Shapes of Python, tuples of at most three whole numbers. Returns how many, or -1 with an error set. */
static int hk_shapes(PyObject *given, hk_shape *shapes) {
  const Py_ssize_t count = PyTuple_GET_SIZE(given);
  if (count > HK_MOST) goto wrong;
  for (Py_ssize_t i = 0; i < count; i++) {
    PyObject *shape = PyTuple_GET_ITEM(given, i);
    if (!PyTuple_Check(shape) || PyTuple_GET_SIZE(shape) > 3) goto wrong;
    shapes[i].dims = (int)PyTuple_GET_SIZE(shape);
    shapes[i].size = 1;
    for (int d = 0; d < shapes[i].dims; d++) {
      shapes[i].dim[d] = PyLong_AsSsize_t(PyTuple_GET_ITEM(shape, d));
      if (shapes[i].dim[d] == -1 && PyErr_Occurred()) return -1;
      shapes[i].size *= shapes[i].dim[d];
    }
  }
  return (int)count;
wrong:
  PyErr_SetString(PyExc_ValueError, "no shapes of arguments or results");
  return -1;
}

static PyObject *hk_new(PyTypeObject *type, PyObject *args, PyObject *named) {
  unsigned long long place, context;
  PyObject *in, *out, *other, *kept;
  (void)named;
  if (!PyArg_ParseTuple(args, "KO!O!OOK", &place, &PyTuple_Type, &in, &PyTuple_Type, &out, &other, &kept, &context))
    return NULL;
  hk_evaluator *e = (hk_evaluator *)type->tp_alloc(type, 0);
  if (!e) return NULL;
  e->call = hk_call;
  e->sample = (hk_sample_t)(size_t)place;
  e->context = (const double *)(size_t)context;
  e->other = Py_NewRef(other);
  e->kept = Py_NewRef(kept);
  if ((e->inputs = hk_shapes(in, e->in)) < 0 || (e->results = hk_shapes(out, e->out)) < 0) Py_CLEAR(e);
  return (PyObject *)e;
}

static int hk_traverse(PyObject *self, visitproc visit, void *arg) {
  Py_VISIT(Py_TYPE(self));
  Py_VISIT(((hk_evaluator *)self)->other);
  Py_VISIT(((hk_evaluator *)self)->kept);
  return 0;
}

static int hk_clear(PyObject *self) {
  Py_CLEAR(((hk_evaluator *)self)->other);
  Py_CLEAR(((hk_evaluator *)self)->kept);
  return 0;
}

static void hk_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyObject_GC_UnTrack(self);
  hk_clear(self);
  type->tp_free(self);
  Py_DECREF(type);
}

static PyMemberDef hk_members[] = {
    {"__vectorcalloffset__", T_PYSSIZET, offsetof(hk_evaluator, call), READONLY, NULL},
    {NULL, 0, 0, 0, NULL},
};
static PyType_Slot hk_slots[] = {
    {Py_tp_new, hk_new},
    {Py_tp_call, PyVectorcall_Call},
    {Py_tp_traverse, hk_traverse},
    {Py_tp_clear, hk_clear},
    {Py_tp_dealloc, hk_dealloc},
    {Py_tp_members, hk_members},
    {0, NULL},
};
static PyType_Spec hk_spec = {"holokin_evaluator.Evaluator", sizeof(hk_evaluator), 0,
                              Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_HAVE_VECTORCALL, hk_slots};
static struct PyModuleDef hk_module = {PyModuleDef_HEAD_INIT, "holokin_evaluator", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_holokin_evaluator(void) {
  import_array();
  PyObject *module = PyModule_Create(&hk_module), *type = PyType_FromSpec(&hk_spec);
  if (!module || !type || PyModule_AddObjectRef(module, "Evaluator", type)) Py_CLEAR(module);
  Py_XDECREF(type);
  return module;
}
