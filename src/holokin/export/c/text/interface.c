/* $title. Written by holokin $version; see $name.h. C99; not for -ffast-math, which hides what is not finite. */
#include "$name.h"
#if ${NAME}_EXPORT != 0x0123456789abcdefU
#error "these files are of different exports: export again"
#endif

#ifdef ${NAME}_FLOAT
#define HK_FLOAT
#define HK_SINGULAR $singular_float
#define HK_REPRESENTATION $representation_float
#define HK_ALMOST $almost_float
#define HK_DONE $done_float
#define HK_PRECISE $precise
#define HK_CLEAR $clear
#define HK_BOTH $both
#define HK_SOUND(c, m) ((c) > HK_C(HK_SINGULAR) && (m) > HK_C(HK_REPRESENTATION) && (c) * (m) > HK_C($least_float))
#else
#define HK_SINGULAR $singular
#define HK_REPRESENTATION $representation
#define HK_ALMOST $almost
#define HK_DONE $done
#endif
#define HK_AT_LIMIT $at_limit
#define HK_CONTRACTION $contraction
#define HK_N $n
#define HK_M $m
#define HK_R $r
#define HK_FRAMES $frames
#define HK_MATRICES $matrices
#define HK_POSE $target
#define HK_TWIST $twist
#define HK_PARAMETERS (2 * HK_R + 5)
#define HK_IMPRECISE ${NAME}_IMPRECISE
#define HK_API static
#define HK_SIMD
$prelude
$bodies
static int hk_finite(const hk_t *x, int count) {
  for (int i = 0; i < count; i++)
    if (!(x[i] - x[i] == HK_C(0))) return 0;
  return 1;
}

/* Single precision, and too near a singularity for four digits. */
static int hk_rough(hk_t rcond, hk_t margin) {
#ifdef HK_PRECISE
  return rcond < HK_C(HK_PRECISE) || margin < HK_C(HK_CLEAR) || rcond * margin < HK_C(HK_BOTH);
#else
  (void)rcond;
  (void)margin;
  return 0;
#endif
}

/* y: `count` results, then rcond and the margin of representations. */
static int hk_deliver(const hk_t *y, int count, hk_t *out) {
  const int sound = HK_SOUND(y[count], y[count + 1]) && hk_finite(y, count);
  for (int i = 0; i < count; i++) out[i] = sound ? y[i] : HK_C(0);
  if (!sound) return ${NAME}_SINGULAR;
  return hk_rough(y[count], y[count + 1]) ? ${NAME}_IMPRECISE : ${NAME}_OK;
}

static int hk_refuse(int count, hk_t *out) {
  for (int i = 0; i < count; i++) out[i] = HK_C(0);
  return ${NAME}_NOT_FINITE;
}

#define HK_ROTATION $rotation
$posed
$step
void ${name}_defaults(${name}_parameters *parameters) {
$defaults}

void ${name}_start(${name}_real q[$n]) {
$start}

int ${name}_pose(const ${name}_real q[$n], ${name}_real T[$poses]) {
  hk_t y[$poses + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse($poses, T);
  hk_pose_body(q, y);
  return hk_deliver(y, $poses, T);
}

int ${name}_gain(const ${name}_real q[$n], ${name}_real G[$nm]) {
  hk_t y[HK_N * HK_M + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(HK_N * HK_M, G);
  hk_gain_body(q, y);
  return hk_deliver(y, HK_N * HK_M, G);
}

int ${name}_rate(const ${name}_real q[$n], const ${name}_real dx[$m], ${name}_real dq[$n]) {
  hk_t x[HK_N + HK_M], y[HK_N + 2];
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_M; i++) x[HK_N + i] = dx[i];
  if (!hk_finite(x, HK_N + HK_M)) return hk_refuse(HK_N, dq);
  hk_rate_body(x, y);
  return hk_deliver(y, HK_N, dq);
}

int ${name}_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real twist[$twist],
    const ${name}_parameters *parameters, ${name}_real dq[$n], ${name}_real *scale) {
  hk_t values[HK_PARAMETERS], out[HK_N + 2];
  const hk_t dt = parameters->dt, gain = parameters->gain, constraint_gain = parameters->constraint_gain;
$leaf_copy  values[2 * HK_R] = dt;
  values[2 * HK_R + 1] = gain;
  values[2 * HK_R + 2] = constraint_gain;
  values[2 * HK_R + 3] = parameters->most_error;
  values[2 * HK_R + 4] = parameters->least_rcond;
  if (!(dt > HK_C(0) && gain >= HK_C(0) && gain * dt < HK_C(2) && constraint_gain >= HK_C(0) &&
        constraint_gain * dt < HK_C(2) && parameters->most_error > HK_C(0) && parameters->least_rcond >= HK_C(0) &&
        parameters->least_rcond < HK_C(1))) {
    *scale = HK_C(0);
    hk_refuse(HK_N, dq);
    return ${NAME}_BAD_PARAMETERS;
  }
  if (hk_finite(target, HK_POSE) && !hk_posed(target, HK_POSE)) {
    *scale = HK_C(0);
    hk_refuse(HK_N, dq);
    return ${NAME}_NOT_A_ROTATION;
  }
  const int status = hk_step(q, target, twist, out, values);
  for (int i = 0; i < HK_N; i++) dq[i] = out[i];
  *scale = out[HK_N];
  return status;
}
$leaf
