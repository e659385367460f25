/* A Python callable (q, pose, dx) -> dq around a C step: buffers in, the calling thread's array out, nothing allocated
   as long as the same thread calls. */
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

typedef int (*hk_step_t)(const double *, const double *, const double *, double *, const double *);

typedef struct {
  hk_step_t step;
  const double *held;
  Py_ssize_t size[3];
  int square;        /* the pose is a 4x4 matrix */
  Py_ssize_t status; /* where in out the status goes */
  PyObject *memory;  /* memory.enter() -> (address of out, dq), each thread's own */
  PyObject *convert; /* convert(...) -> (q, pose, dx), or an error that says what is wrong */
  PyObject *kept;    /* what the addresses above belong to */
  uint64_t thread;   /* that called last, 0 for none: Python gives no number twice, unlike the system */
  double *out;       /* its results */
  PyObject *dq;
} hk_bound;

static void hk_free(PyObject *capsule) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(capsule, "hk_bound");
  Py_XDECREF(b->dq);
  Py_DECREF(b->memory);
  Py_DECREF(b->convert);
  Py_DECREF(b->kept);
  PyMem_Free(b);
}

/* Turn to the results of the calling thread. Returns 0, or -1 with an error set. */
static int hk_enter(hk_bound *b, uint64_t thread) {
  PyObject *found = PyObject_CallMethod(b->memory, "enter", NULL), *dq, *before;
  unsigned long long place;
  if (!found) return -1;
  if (!PyArg_ParseTuple(found, "KO", &place, &dq)) {
    Py_DECREF(found);
    return -1;
  }
  Py_INCREF(dq);
  Py_DECREF(found);
  before = b->dq;
  b->thread = thread; /* all of it with no Python in between: no other thread sees one without the others */
  b->out = (double *)(size_t)place;
  b->dq = dq;
  Py_XDECREF(before);
  return 0;
}

/* The step of three buffers. Returns 1, or 0 where they are no aligned, contiguous float arrays of the right shape. */
static int hk_run(const hk_bound *b, PyObject *const *args, double *out) {
  Py_buffer view[3];
  int got = 0, fit = 1;
  for (; fit && got < 3; got++) {
    if (PyObject_GetBuffer(args[got], &view[got], PyBUF_C_CONTIGUOUS | PyBUF_FORMAT)) {
      PyErr_Clear();
      break;
    }
    const int rows = got == 1 && b->square ? 2 : 1;
    fit = view[got].ndim == rows && (rows == 1 || view[got].shape[0] == 4) && view[got].itemsize == 8 &&
          view[got].len == 8 * b->size[got] && view[got].format[0] == 'd' && !view[got].format[1] &&
          (size_t)view[got].buf % sizeof(double) == 0;
  }
  fit = fit && got == 3;
  if (fit)
    out[b->status] =
        b->step((const double *)view[0].buf, (const double *)view[1].buf, (const double *)view[2].buf, out, b->held);
  for (int i = 0; i < got; i++) PyBuffer_Release(&view[i]);
  return fit;
}

/* The same of what is no such array. Returns 1, or 0 with an error set. */
static int hk_run_converted(const hk_bound *b, PyObject *const *args, Py_ssize_t count, double *out) {
  PyObject *given = PyTuple_New(count), *made, *items[3];
  int done = 0;
  if (!given) return 0;
  for (Py_ssize_t i = 0; i < count; i++) {
    Py_INCREF(args[i]);
    PyTuple_SetItem(given, i, args[i]);
  }
  made = PyObject_CallObject(b->convert, given);
  Py_DECREF(given);
  if (!made) return 0;
  if (PyTuple_Check(made) && PyTuple_Size(made) == 3) {
    for (int i = 0; i < 3; i++) items[i] = PyTuple_GetItem(made, i);
    done = hk_run(b, items, out);
  }
  if (!done) PyErr_SetString(PyExc_SystemError, "the arguments of a step were not converted");
  Py_DECREF(made);
  return done;
}

static PyObject *hk_call(PyObject *self, PyObject *const *args, Py_ssize_t count) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(self, "hk_bound");
  const uint64_t thread = PyThreadState_GetID(PyThreadState_Get());
  if (thread != b->thread && hk_enter(b, thread)) return NULL;
  double *out = b->out; /* converting runs Python, and another thread may turn b to its own results */
  PyObject *dq = b->dq;
  Py_INCREF(dq);
  if ((count == 3 && hk_run(b, args, out)) || hk_run_converted(b, args, count, out)) return dq;
  Py_DECREF(dq);
  return NULL;
}

static PyMethodDef hk_call_def = {"step", (PyCFunction)(void (*)(void))hk_call, METH_FASTCALL,
                                  "step(q, pose, dx) -> dq"};

static PyObject *hk_bind(PyObject *module, PyObject *args) {
  unsigned long long step, held;
  Py_ssize_t size[3], status;
  int square;
  PyObject *memory, *convert, *kept, *capsule, *callable;
  (void)module;
  if (!PyArg_ParseTuple(args, "KKnnninOOO", &step, &held, &size[0], &size[1], &size[2], &square, &status, &memory,
                        &convert, &kept))
    return NULL;
  hk_bound *b = (hk_bound *)PyMem_Malloc(sizeof(hk_bound));
  if (!b) return PyErr_NoMemory();
  b->step = (hk_step_t)(size_t)step;
  b->held = (const double *)(size_t)held;
  for (int i = 0; i < 3; i++) b->size[i] = size[i];
  b->status = status;
  b->square = square;
  Py_INCREF(memory);
  Py_INCREF(convert);
  Py_INCREF(kept);
  b->memory = memory;
  b->convert = convert;
  b->kept = kept;
  b->thread = 0;
  b->out = NULL;
  b->dq = NULL;
  capsule = PyCapsule_New(b, "hk_bound", hk_free);
  if (!capsule) return NULL;
  callable = PyCFunction_NewEx(&hk_call_def, capsule, NULL);
  Py_DECREF(capsule);
  return callable;
}

static PyMethodDef hk_methods[] = {{"bind", hk_bind, METH_VARARGS, "bind a C step"}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef hk_module = {PyModuleDef_HEAD_INIT, "holokin_glue", NULL, -1, hk_methods, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit_holokin_glue(void) { return PyModule_Create(&hk_module); }
