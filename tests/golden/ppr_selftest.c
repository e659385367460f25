/* Self-test of ppr: the numbers that holokin computed, and what must not happen. Returns 0 when all is well.
   Written by holokin 0.2.0. */
#include <math.h>
#include <stdio.h>

#include "ppr.h"
#include "ppr_vectors.h"
#if PPR_EXPORT != 0x9a9dcc78cb4de268U
#error "these files are of different exports: export again"
#endif
#if PPR_VECTORS != 0x9a9dcc78cb4de268U
#error "these files are of different exports: export again"
#endif

#ifdef PPR_FLOAT
#define TOLERANCE 1e-4
#define PRECISION "float"
#else
#define TOLERANCE 1e-12
#define PRECISION "double"
#endif
#define COUNT ((int)(sizeof vectors / sizeof vectors[0]))

typedef ppr_real real;

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
  if (status == PPR_OK || (rough && status == PPR_IMPRECISE)) return 1;
  if (rough && (status == PPR_SINGULAR || status == PPR_NOT_CONVERGED)) return 0;
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
  real q[3], target[3], dx[2], twist[3], T[16], G[6], dq[3], scale;
  ppr_parameters parameters;
  real c[1], g[1];
  ppr_defaults(&parameters);
  parameters.most_error = (real)1e30; /* the vectors are of any distance, and near singular postures, too */
  parameters.least_rcond = (real)0;
  for (int k = 0; k < COUNT; k++) {
    const vector *v = &vectors[k];
#ifdef PPR_FLOAT
    const double most = v->precise ? TOLERANCE : 1e-2;
    const double fed_back = most * (v->precise ? v->terms : fmax(1.0, (double)parameters.gain / 100.0));
#else
    const double most = TOLERANCE * v->loss;
    const double fed_back = most * fmax(1.0, (double)parameters.gain / 100.0); /* it multiplies what the pose is off */
#endif
    copy(v->q, q, 3);
    copy(v->target, target, 3);
    copy(v->dx, dx, 2);
    copy(v->twist, twist, 3);
    const int status = ppr_gain(q, G), rough = !v->precise && sizeof(real) < sizeof(double);
    if (rough && status == PPR_SINGULAR) continue; /* too near a singularity for single precision */
    tested++;
    if (accept("gain", k, status, rough)) worst[1] = compare("gain", k, G, v->gain, 6, most, worst[1]);
    if (accept("pose", k, ppr_pose(q, T), rough)) worst[0] = compare("pose", k, T, v->pose, 16, TOLERANCE, worst[0]);
    if (accept("rate", k, ppr_rate(q, dx, dq), rough)) worst[2] = compare("rate", k, dq, v->rate, 3, most, worst[2]);
    copy(v->leaf_rate, parameters.leaf_rate, 1);
    const int stepped = ppr_step(q, target, twist, &parameters, dq, &scale);
    if (stepped == v->status || accept("step", k, stepped, rough)) {
      worst[3] = compare("step", k, dq, v->step, 3, fed_back, worst[3]);
      worst[3] = compare("scale", k, &scale, &v->scale, 1, fed_back, worst[3]);
    }
    copy(v->c, c, 1);
    if (accept("constraint", k, ppr_constraint(q, g), rough))
      worst[4] = compare("constraint", k, g, v->g, 1, most, worst[4]);
    if (accept("leaf step", k, ppr_leaf_step(q, target, c, dq), rough))
      worst[5] = compare("leaf step", k, dq, v->leaf, 3, fed_back, worst[5]);
    if (accept("inverse", k, ppr_inverse(q, target, c, 200), rough))
      worst[6] = compare("inverse", k, q, v->inverse, 3, 10 * most, worst[6]);
    copy(v->away, target, 3);
    if (accept("solve", k, ppr_solve(q, target, 200), rough))
      worst[6] = compare("solve", k, q, v->solved, 3, 10 * most, worst[6]);
  }
  const real bad[3] = {(real)NAN, (real)INFINITY, -(real)INFINITY};
  for (int b = 0; b < 3; b++) {
    copy(vectors[0].q, q, 3);
    copy(vectors[0].target, target, 3);
    copy(vectors[0].dx, dx, 2);
    copy(vectors[0].twist, twist, 3);
    for (int i = 0; i < 2; i++) {
      const real good = dx[i];
      dx[i] = bad[b];
      expect("rate of a bad dx", ppr_rate(q, dx, dq), PPR_NOT_FINITE, dq, 3);
      dx[i] = good;
    }
    for (int i = 0; i < 3; i++) {
      const real good = twist[i];
      twist[i] = bad[b];
      expect("step of a bad twist", ppr_step(q, target, twist, &parameters, dq, &scale), PPR_NOT_FINITE, dq, 3);
      twist[i] = good;
    }
    for (int i = 0; i < 3; i++) {
      const real good = target[i];
      target[i] = bad[b];
      expect("step to a bad target", ppr_step(q, target, twist, &parameters, dq, &scale), PPR_NOT_FINITE, dq, 3);
      copy(vectors[0].c, c, 1);
      expect("leaf step to a bad target", ppr_leaf_step(q, target, c, dq), PPR_NOT_FINITE, dq, 3);
      expect("inverse of a bad target", ppr_inverse(q, target, c, 200), PPR_NOT_FINITE, dq, 0);
      expect("solve for a bad target", ppr_solve(q, target, 200), PPR_NOT_FINITE, dq, 0);
      target[i] = good;
    }
    for (int i = 0; i < 3; i++) {
      const real good = q[i];
      q[i] = bad[b];
      expect("pose of a bad q", ppr_pose(q, T), PPR_NOT_FINITE, T, 16);
      expect("gain of a bad q", ppr_gain(q, G), PPR_NOT_FINITE, G, 6);
      expect("step of a bad q", ppr_step(q, target, twist, &parameters, dq, &scale), PPR_NOT_FINITE, dq, 3);
      q[i] = good;
    }
    ppr_parameters odd = parameters;
    odd.dt = bad[b];
    expect("step with a bad dt", ppr_step(q, target, twist, &odd, dq, &scale), PPR_BAD_PARAMETERS, dq, 3);
    odd.dt = -parameters.dt;
    expect("step with a negative dt", ppr_step(q, target, twist, &odd, dq, &scale), PPR_BAD_PARAMETERS, dq, 3);
  }
  printf("ppr, %s: %d test cases, largest differences: pose %.1e, gain %.1e, rate %.1e, step %.1e, constraint %.1e, leaf step %.1e, inverse %.1e; %s\n",
         PRECISION, tested, worst[0], worst[1], worst[2], worst[3], worst[4], worst[5], worst[6], failures ? "FAILED" : "passed");
  return failures ? 1 : 0;
}
