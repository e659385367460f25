/* Self-test of $name: the numbers that holokin computed, and what must not happen. Returns 0 when all is well.
   Written by holokin $version. */
#include <math.h>
#include <stdio.h>

#include "$name.h"
#include "${name}_vectors.h"
#if ${NAME}_EXPORT != 0x0123456789abcdefU
#error "these files are of different exports: export again"
#endif
#if ${NAME}_VECTORS != 0x0123456789abcdefU
#error "these files are of different exports: export again"
#endif

#ifdef ${NAME}_FLOAT
#define TOLERANCE 1e-4
#define PRECISION "float"
#else
#define TOLERANCE 1e-12
#define PRECISION "double"
#endif
#define COUNT ((int)(sizeof vectors / sizeof vectors[0]))

typedef ${name}_real real;

static int failures, tested;

/* `count` numbers against those wanted, in shares of the largest or of 1; returns the larger of this and `worst`. */
static double compare(const char *what, int k, const real *got, const double *wanted, int count, double most, double worst) {
  double size = 1.0, error = 0.0;
  for (int i = 0; i < count; i++) size = fmax(size, fabs(wanted[i]));
  for (int i = 0; i < count; i++) {
    const double off = fabs((double)got[i] - wanted[i]) / size;
    if (off > error || !(off - off == 0.0)) error = off; /* what is not a number stays */
    if (!(error - error == 0.0)) break;
  }
  if (!(error <= most)) {
    printf("%s: vector %d is off by %g\n", what, k, error);
    failures++;
  }
  return error > worst ? error : worst;
}

/* A vector's status is OK, or, where single precision is rough, IMPRECISE, or one of those without a result, past which
   round-off may lead there. 1 where there is a result to compare. */
static int accept(const char *what, int k, int status, int rough) {
  if (status == ${NAME}_OK || (rough && status == ${NAME}_IMPRECISE)) return 1;
  if (rough && (status == ${NAME}_SINGULAR || status == ${NAME}_NOT_CONVERGED)) return 0;
  printf("%s: vector %d has status %d\n", what, k, status);
  failures++;
  return 0;
}

static void expect(const char *what, int status, int wanted, const real *result, int count) {
  int zero = 1;
  for (int i = 0; i < count; i++) zero &= (result[i] == (real)0);
  if (status != wanted || !zero) {
    printf("%s: status %d instead of %d, results %s\n", what, status, wanted, zero ? "zero" : "not zero");
    failures++;
  }
}

static void copy(const double *from, real *to, int count) {
  for (int i = 0; i < count; i++) to[i] = (real)from[i];
}

int main(void) {
  double worst[7] = {0};
  real q[$n], target[$target], dx[$m], twist[$twist], T[$poses], G[$nm], dq[$n], scale;
  ${name}_parameters parameters;
$declare_leaf  ${name}_defaults(&parameters);
  parameters.most_error = (real)1e30; /* the vectors are of any distance, and near singular postures, too */
  parameters.least_rcond = (real)0;
  for (int k = 0; k < COUNT; k++) {
    const vector *v = &vectors[k];
#ifdef ${NAME}_FLOAT
    const double most = v->precise ? TOLERANCE : 1e-2;
    const double fed_back = most * (v->precise ? v->terms : fmax(1.0, (double)parameters.gain / 100.0));
#else
    const double most = TOLERANCE * v->loss;
    const double fed_back = most * fmax(1.0, (double)parameters.gain / 100.0); /* it multiplies what the pose is off */
#endif
    copy(v->q, q, $n);
    copy(v->target, target, $target);
    copy(v->dx, dx, $m);
    copy(v->twist, twist, $twist);
    const int status = ${name}_gain(q, G), rough = !v->precise && sizeof(real) < sizeof(double);
    if (rough && status == ${NAME}_SINGULAR) continue; /* too near a singularity for single precision */
    tested++;
    if (accept("gain", k, status, rough)) worst[1] = compare("gain", k, G, v->gain, $nm, most, worst[1]);
    if (accept("pose", k, ${name}_pose(q, T), rough)) worst[0] = compare("pose", k, T, v->pose, $poses, TOLERANCE, worst[0]);
    if (accept("rate", k, ${name}_rate(q, dx, dq), rough)) worst[2] = compare("rate", k, dq, v->rate, $n, most, worst[2]);
$moving_leaf    const int stepped = ${name}_step(q, target, twist, &parameters, dq, &scale);
    if (stepped == v->status || accept("step", k, stepped, rough)) {
      worst[3] = compare("step", k, dq, v->step, $n, fed_back, worst[3]);
      worst[3] = compare("scale", k, &scale, &v->scale, 1, fed_back, worst[3]);
    }
$leaf_tests  }
  const real bad[3] = {(real)NAN, (real)INFINITY, -(real)INFINITY};
  for (int b = 0; b < 3; b++) {
    copy(vectors[0].q, q, $n);
    copy(vectors[0].target, target, $target);
    copy(vectors[0].dx, dx, $m);
    copy(vectors[0].twist, twist, $twist);
    for (int i = 0; i < $m; i++) {
      const real good = dx[i];
      dx[i] = bad[b];
      expect("rate of a bad dx", ${name}_rate(q, dx, dq), ${NAME}_NOT_FINITE, dq, $n);
      dx[i] = good;
    }
    for (int i = 0; i < $twist; i++) {
      const real good = twist[i];
      twist[i] = bad[b];
      expect("step of a bad twist", ${name}_step(q, target, twist, &parameters, dq, &scale), ${NAME}_NOT_FINITE, dq, $n);
      twist[i] = good;
    }
    for (int i = 0; i < $target; i++) {
      const real good = target[i];
      target[i] = bad[b];
      expect("step to a bad target", ${name}_step(q, target, twist, &parameters, dq, &scale), ${NAME}_NOT_FINITE, dq, $n);
$bad_leaf      target[i] = good;
    }
    for (int i = 0; i < $n; i++) {
      const real good = q[i];
      q[i] = bad[b];
      expect("pose of a bad q", ${name}_pose(q, T), ${NAME}_NOT_FINITE, T, $poses);
      expect("gain of a bad q", ${name}_gain(q, G), ${NAME}_NOT_FINITE, G, $nm);
      expect("step of a bad q", ${name}_step(q, target, twist, &parameters, dq, &scale), ${NAME}_NOT_FINITE, dq, $n);
      q[i] = good;
    }
    ${name}_parameters odd = parameters;
    odd.dt = bad[b];
    expect("step with a bad dt", ${name}_step(q, target, twist, &odd, dq, &scale), ${NAME}_BAD_PARAMETERS, dq, $n);
    odd.dt = -parameters.dt;
    expect("step with a negative dt", ${name}_step(q, target, twist, &odd, dq, &scale), ${NAME}_BAD_PARAMETERS, dq, $n);
  }
$singular_test  printf("$name, %s: %d test cases, largest differences: pose %.1e, gain %.1e, rate %.1e, step %.1e$leaf_words; %s\n",
         PRECISION, tested, worst[0], worst[1], worst[2], worst[3]$leaf_worst, failures ? "FAILED" : "passed");
  return failures ? 1 : 0;
}
