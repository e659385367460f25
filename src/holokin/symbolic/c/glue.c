/* A Python callable (q, pose, dx) -> dq around a C step: buffers in, one array out, nothing allocated. */
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

typedef int (*hk_step_t)(const double *, const double *, const double *, double *, const double *);

typedef struct {
  hk_step_t step;
  const double *leaf;
  double *out;
  Py_ssize_t size[3];
  int square; /* the pose is a 4x4 matrix */
  Py_ssize_t status; /* where in out the status goes */
  PyObject *answer, *slow;
} hk_bound;

static void hk_free(PyObject *capsule) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(capsule, "hk_bound");
  Py_DECREF(b->answer);
  Py_DECREF(b->slow);
  PyMem_Free(b);
}

static PyObject *hk_call(PyObject *self, PyObject *const *args, Py_ssize_t count) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(self, "hk_bound");
  Py_buffer view[3];
  int got = 0, fit = count == 3;
  for (; fit && got < 3; got++) {
    if (PyObject_GetBuffer(args[got], &view[got], PyBUF_C_CONTIGUOUS | PyBUF_FORMAT)) {
      PyErr_Clear();
      break;
    }
    const int rows = got == 1 && b->square ? 2 : 1;
    fit = view[got].ndim == rows && (rows == 1 || view[got].shape[0] == 4) && view[got].itemsize == 8 && view[got].len == 8 * b->size[got] && view[got].format[0] == 'd' && !view[got].format[1];
  }
  const int ready = fit && got == 3;
  if (ready)
    b->out[b->status] =
        b->step((const double *)view[0].buf, (const double *)view[1].buf, (const double *)view[2].buf, b->out, b->leaf);
  for (int i = 0; i < got; i++) PyBuffer_Release(&view[i]);
  if (!ready) { /* lists, other types, wrong shapes: Python converts, or says what is wrong */
    PyObject *tuple = PyTuple_New(count), *answer;
    if (!tuple) return NULL;
    for (Py_ssize_t i = 0; i < count; i++) {
      Py_INCREF(args[i]);
      PyTuple_SetItem(tuple, i, args[i]);
    }
    answer = PyObject_CallObject(b->slow, tuple);
    Py_DECREF(tuple);
    return answer;
  }
  Py_INCREF(b->answer);
  return b->answer;
}

static PyMethodDef hk_call_def = {"step", (PyCFunction)(void (*)(void))hk_call, METH_FASTCALL,
                                  "step(q, pose, dx) -> dq"};

static PyObject *hk_bind(PyObject *module, PyObject *args) {
  unsigned long long step, leaf, out;
  Py_ssize_t size[3], status;
  int square;
  PyObject *answer, *slow, *capsule, *callable;
  (void)module;
  if (!PyArg_ParseTuple(args, "KKKnnninOO", &step, &leaf, &out, &size[0], &size[1], &size[2], &square, &status, &answer,
                        &slow))
    return NULL;
  hk_bound *b = (hk_bound *)PyMem_Malloc(sizeof(hk_bound));
  if (!b) return PyErr_NoMemory();
  b->step = (hk_step_t)(size_t)step;
  b->leaf = (const double *)(size_t)leaf;
  b->out = (double *)(size_t)out;
  for (int i = 0; i < 3; i++) b->size[i] = size[i];
  b->status = status;
  b->square = square;
  Py_INCREF(answer);
  Py_INCREF(slow);
  b->answer = answer;
  b->slow = slow;
  capsule = PyCapsule_New(b, "hk_bound", hk_free);
  if (!capsule) return NULL;
  callable = PyCFunction_NewEx(&hk_call_def, capsule, NULL);
  Py_DECREF(capsule);
  return callable;
}

static PyMethodDef hk_methods[] = {{"bind", hk_bind, METH_VARARGS, "bind a C step"}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef hk_module = {PyModuleDef_HEAD_INIT, "holokin_glue", NULL, -1, hk_methods, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit_holokin_glue(void) { return PyModule_Create(&hk_module); }
