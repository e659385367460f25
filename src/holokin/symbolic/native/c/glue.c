/* A Python callable (q, pose, twist) -> dq around a C step: arrays in, a new array out. */
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <string.h>

typedef int (*hk_step_t)(const double *, const double *, const double *, double *, const double *);

/* The head of NumPy's array object, the same in its versions 1 and 2; `know` looks whether it is so here. */
typedef struct {
  PyObject_HEAD
  char *data;
  int rank;
  Py_ssize_t *shape, *strides;
  PyObject *base, *type;
  int flags;
} hk_array;

enum { HK_PLAIN = 0x0101, HK_OWN = 0x0505 }; /* flags of an array that is aligned and lies in rows; and is a new one's */

static PyTypeObject *hk_array_type;     /* numpy.ndarray */
static PyObject *hk_double, *hk_empty;  /* numpy.dtype(float), numpy.empty */

typedef struct {
  hk_step_t step;
  const double *parameters;
  Py_ssize_t joints;
  int point, frames;  /* numbers of a position, where the task is one: points and their velocities will do; how many frames */
  PyObject *size;     /* joints, for numpy.empty */
  PyObject *memory;   /* memory.enter() -> address of out, each thread's own */
  PyObject *convert;  /* convert(q, pose, twist) -> the same as plain arrays, or an error that says what is wrong */
  PyObject *kept;     /* what the addresses above belong to */
  uint64_t thread;    /* that called last, 0 for none: Python gives no number twice, unlike the system */
  double *out;        /* its results: dq, scale, holding, status */
  PyObject *given[2]; /* the last arrays that were returned */
} hk_bound;

static void hk_free(PyObject *capsule) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(capsule, "hk_bound");
  Py_XDECREF(b->given[0]);
  Py_XDECREF(b->given[1]);
  Py_DECREF(b->size);
  Py_DECREF(b->memory);
  Py_DECREF(b->convert);
  Py_DECREF(b->kept);
  PyMem_Free(b);
}

/* Turn to the results of the calling thread. Returns 0, or -1 with an error set. */
static int hk_enter(hk_bound *b, uint64_t thread) {
  PyObject *found = PyObject_CallMethod(b->memory, "enter", NULL);
  if (!found) return -1;
  double *out = (double *)PyLong_AsVoidPtr(found);
  Py_DECREF(found);
  if (!out) return -1;
  b->thread = thread; /* both with no Python in between: no other thread sees one without the other */
  b->out = out;
  return 0;
}

/* Where the numbers of an array (size,) or (size, size) are, or NULL where it is no plain one of floats. */
static const double *hk_numbers(PyObject *given, int rank, Py_ssize_t size) {
  const hk_array *a = (const hk_array *)given;
  if (Py_TYPE(given) != hk_array_type || a->type != hk_double || (a->flags & HK_PLAIN) != HK_PLAIN) return NULL;
  if (a->rank != rank || a->shape[0] != size || a->shape[rank - 1] != size) return NULL;
  return (const double *)a->data;
}

/* The same of what has `rows` and columns for each of several frames, side by side or one below the other. */
static const double *hk_numbers_of(PyObject *given, int frames, Py_ssize_t rows, Py_ssize_t columns) {
  const hk_array *a = (const hk_array *)given;
  if (Py_TYPE(given) != hk_array_type || a->type != hk_double || (a->flags & HK_PLAIN) != HK_PLAIN) return NULL;
  const int side = a->rank == 3 && a->shape[0] == frames && a->shape[1] == rows && a->shape[2] == columns;
  const int below = a->rank == 2 && a->shape[0] == frames * rows && a->shape[1] == columns;
  const int flat = rows == 1 && a->rank == 1 && a->shape[0] == frames * columns;
  return side || below || flat ? (const double *)a->data : NULL;
}

/* 1 where the last row of a pose is not 0 0 0 1, as where it is transposed; what is not finite the step itself refuses. */
static int hk_odd_row(const double *pose, int frames) {
  int odd = 0;
  for (int i = 0; i < 16 * frames; i++) {
    const double off = pose[i] - (i % 16 == 15);
    odd |= i % 16 >= 12 && off - off == 0.0 && !(off < HK_OFF && off > -HK_OFF);
  }
  return odd;
}

/* The step of three plain arrays. Returns 1, or 0 where they are none. */
static int hk_run(const hk_bound *b, PyObject *const *args, double *out) {
  double point[3];
  const double *q = hk_numbers(args[0], 1, b->joints), *pose, *twist;
  if (b->frames > 1) {
    pose = b->point ? hk_numbers(args[1], 1, b->point) : hk_numbers_of(args[1], b->frames, 4, 4);
    twist = b->point ? hk_numbers(args[2], 1, b->point) : hk_numbers_of(args[2], b->frames, 1, 6);
  } else {
    pose = hk_numbers(args[1], 2, 4);
    twist = hk_numbers(args[2], 1, 6);
  }
  if (pose && !(b->point && b->frames > 1) && hk_odd_row(pose, b->frames)) return 0;
  if (b->point && b->frames == 1) {
    for (int i = 0; pose && i < 3; i++) point[i] = pose[4 * i + 3];
    pose = pose ? point : hk_numbers(args[1], 1, 3);
    twist = twist ? twist : hk_numbers(args[2], 1, 3); /* of a whole twist the first three are the velocity */
  }
  if (!q || !pose || !twist) return 0;
  out[b->joints + 2] = b->step(q, pose, twist, out, b->parameters);
  return 1;
}

/* The same of other arguments. Returns 1, or 0 with an error set. */
static int hk_run_converted(const hk_bound *b, PyObject *const *args, double *out) {
  PyObject *made = PyObject_CallFunctionObjArgs(b->convert, args[0], args[1], args[2], NULL), *items[3];
  int done = 0;
  if (!made) return 0;
  if (PyTuple_Check(made) && PyTuple_Size(made) == 3) {
    for (int i = 0; i < 3; i++) items[i] = PyTuple_GetItem(made, i);
    done = hk_run(b, items, out);
  }
  if (!done) PyErr_SetString(PyExc_SystemError, "the arguments of a step were not converted");
  Py_DECREF(made);
  return done;
}

/* An array for the results. One of the last two that were returned, if nobody has it any more, nor a view of it: that
   takes half as long as `empty`. Returns NULL with an error set. */
static PyObject *hk_new(hk_bound *b) {
  for (int i = 0; i < 2; i++) {
    PyObject *old = b->given[i];
    if (old && Py_REFCNT(old) == 1 && hk_numbers(old, 1, b->joints) && (((hk_array *)old)->flags & HK_OWN) == HK_OWN) {
      Py_INCREF(old);
      return old;
    }
  }
  PyObject *made = PyObject_CallFunctionObjArgs(hk_empty, b->size, NULL), *before = b->given[0];
  if (!made) return NULL;
  Py_INCREF(made);
  b->given[0] = b->given[1];
  b->given[1] = made;
  Py_XDECREF(before);
  return made;
}

static PyObject *hk_call(PyObject *self, PyObject *const *args, Py_ssize_t count) {
  hk_bound *b = (hk_bound *)PyCapsule_GetPointer(self, "hk_bound");
  const uint64_t thread = PyThreadState_GetID(PyThreadState_Get());
  if (count != 3) {
    PyErr_SetString(PyExc_TypeError, "a step takes q, pose and twist");
    return NULL;
  }
  if (thread != b->thread && hk_enter(b, thread)) return NULL;
  double *out = b->out; /* converting runs Python, and another thread may turn b to its own results */
  if (!hk_run(b, args, out) && !hk_run_converted(b, args, out)) return NULL;
  PyObject *dq = hk_new(b);
  if (dq) memcpy(((hk_array *)dq)->data, out, (size_t)b->joints * sizeof(double));
  return dq;
}

static PyMethodDef hk_call_def = {"step", (PyCFunction)(void (*)(void))hk_call, METH_FASTCALL,
                                  "step(q, pose, twist) -> dq"};

static PyObject *hk_bind(PyObject *module, PyObject *args) {
  PyObject *step, *parameters, *memory, *convert, *kept, *capsule, *callable;
  Py_ssize_t joints;
  int point, frames;
  (void)module;
  if (!PyArg_ParseTuple(args, "OOniiOOO", &step, &parameters, &joints, &point, &frames, &memory, &convert, &kept)) return NULL;
  hk_bound *b = (hk_bound *)PyMem_Malloc(sizeof(hk_bound));
  if (!b) return PyErr_NoMemory();
  b->step = (hk_step_t)(size_t)PyLong_AsVoidPtr(step);
  b->parameters = (const double *)PyLong_AsVoidPtr(parameters);
  b->joints = joints;
  b->point = point;
  b->frames = frames;
  b->size = PyLong_FromSsize_t(joints);
  Py_INCREF(memory);
  Py_INCREF(convert);
  Py_INCREF(kept);
  b->memory = memory;
  b->convert = convert;
  b->kept = kept;
  b->thread = 0;
  b->out = NULL;
  b->given[0] = b->given[1] = NULL;
  capsule = PyCapsule_New(b, "hk_bound", hk_free);
  if (!capsule) return NULL;
  callable = PyCFunction_NewEx(&hk_call_def, capsule, NULL);
  Py_DECREF(capsule);
  return callable;
}

static int hk_is(PyObject *given, PyObject *type, Py_ssize_t rows, Py_ssize_t columns, Py_ssize_t stride, void *place) {
  const hk_array *a = (const hk_array *)given;
  return (void *)a->data == place && a->rank == 2 && a->shape[0] == rows && a->shape[1] == columns &&
         a->strides[0] == stride && a->type == type;
}

/* know(ndarray, its size, dtype, empty, an array (3, 5) nobody may write to, its transpose, an array that is not
   aligned, the first one's address): True where arrays are laid out as above. Each is read only after what leads to it
   fits. */
static PyObject *hk_know(PyObject *module, PyObject *args) {
  PyObject *array, *type, *empty, *sample, *turned, *odd, *place;
  Py_ssize_t size;
  (void)module;
  if (!PyArg_ParseTuple(args, "OnOOOOOO", &array, &size, &type, &empty, &sample, &turned, &odd, &place)) return NULL;
  void *at = PyLong_AsVoidPtr(place);
  if (!(size >= (Py_ssize_t)sizeof(hk_array) && hk_is(sample, type, 3, 5, 40, at) && hk_is(turned, type, 5, 3, 8, at) &&
        (((hk_array *)sample)->flags & HK_OWN) == 0x0105 && (((hk_array *)turned)->flags & HK_PLAIN) == 0x0100 &&
        (((hk_array *)odd)->flags & HK_PLAIN) == 1))
    Py_RETURN_FALSE;
  Py_INCREF(array); /* for as long as the process: what is bound needs them */
  Py_INCREF(type);
  Py_INCREF(empty);
  hk_array_type = (PyTypeObject *)array;
  hk_double = type;
  hk_empty = empty;
  Py_RETURN_TRUE;
}

static PyMethodDef hk_methods[] = {{"bind", hk_bind, METH_VARARGS, "bind a C step"},
                                   {"know", hk_know, METH_VARARGS, "look at how arrays are laid out"},
                                   {NULL, NULL, 0, NULL}};
static struct PyModuleDef hk_module = {PyModuleDef_HEAD_INIT, "holokin_glue", NULL, -1, hk_methods, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit_holokin_glue(void) { return PyModule_Create(&hk_module); }
