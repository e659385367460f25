/* The doors of inverse kinematics. hk_pose_body: q -> (T, ...), 16 numbers a frame first; hk_constraint_body: q -> g.
   A context is a row of numbers: the start, its poses (p, R), the leaf c, the joints' lower and upper limits, the sign of
   det there, and how far the tool may turn from there before coordinates jump that g takes. It is only read, so that
   threads may share it. */
#include <string.h>

enum { HK_START = 0, HK_FROM = HK_N, HK_LEAF = HK_FROM + HK_TARGET, HK_LOWER = HK_LEAF + HK_R, HK_UPPER = HK_LOWER + HK_N,
       HK_SIDE = HK_UPPER + HK_N, HK_TURN };
enum { HK_REACHED, HK_CLAMPED, HK_LIMIT, HK_LEAF_ENDS, HK_AT_SINGULAR, HK_NOT_CONVERGED, HK_NOT_FINITE, HK_NOT_A_ROTATION,
       HK_OTHER_BRANCH };

static const hk_rules hk_ours = HK_RULES;
#ifndef HK_STRETCHES
typedef char hk_region; /* none is ever found */
#endif

static int hk_finite(const double *x, int count) {
  for (int i = 0; i < count; i++)
    if (!(x[i] - x[i] == 0.0)) return 0;
  return 1;
}

static int hk_beyond_limits(const double *q, const double *context) {
  for (int i = 0; i < HK_N; i++)
    if (!(q[i] >= context[HK_LOWER + i] && q[i] <= context[HK_UPPER + i])) return 1;
  return 0;
}

/* How a way is gone: by continuation, and from where that gives up in pieces that are shown to keep to the branch; in such
   pieces alone; by continuation alone, where the law has one. */
enum { HK_BOTH, HK_SHOWN, HK_QUICK };

/* The way from q, whose pose and level are given, to a pose `to` (p, R). q becomes the posture where it ended. */
static int hk_answer(double *q, const double *from, const double *g, const double *to, const double *context, int how) {
  double x[HK_N + HK_TARGET + HK_R], y[HK_N + 3];
  hk_rules rules = hk_ours;
  hk_way way;
  rules.side = context[HK_SIDE];
  hk_way_to(from, g, to, context + HK_LEAF, &way);
  hk_t share = HK_C(0);
#ifdef HK_CONTINUED
  if (how != HK_SHOWN && way.turn < context[HK_TURN]) {
    share = hk_continue(&way, &rules, q);
    if (how == HK_QUICK && share < HK_C(1)) return HK_NOT_CONVERGED;
  }
#else
  (void)how;
#endif
  const int ended = hk_go(&way, &rules, share, q, x);
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  if (ended == 0) return hk_beyond_limits(q, context) ? HK_LIMIT : HK_REACHED;
  if (ended == 3) return HK_LEAF_ENDS;
  hk_aim(&way, 0.0, x);
  hk_leaf_body(x, y);
  if (ended == 2 || y[HK_N] > HK_REGULAR) return HK_NOT_CONVERGED;
  return y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation ? HK_LEAF_ENDS : HK_AT_SINGULAR;
}

/* From the start. Where no posture of the arm at all has the pose, q is not a number. */
static int hk_cold(const double *to, const double *context, int how, double *q) {
  for (int i = 0; i < HK_N; i++) q[i] = NAN;
  if (!hk_finite(to, HK_TARGET)) return HK_NOT_FINITE;
  if (!hk_all_rotate(to)) return HK_NOT_A_ROTATION;
  if (how != HK_SHOWN && hk_nowhere(to, context + HK_START)) return HK_LEAF_ENDS;
  for (int i = 0; i < HK_N; i++) q[i] = context[HK_START + i];
  return hk_answer(q, context + HK_FROM, context + HK_LEAF, to, context, how);
}

/* From the posture in q; region: one of the law, about whatever posture, which becomes one about q where it was none. */
static int hk_warm(const double *to, const double *context, int how, hk_region *region, double *q) {
  double T[16 * HK_FRAMES + 2], from[HK_TARGET], g[HK_R + 1], x[HK_N + HK_TARGET + HK_R], y[HK_N + 3];
  if (!hk_finite(to, HK_TARGET) || !hk_finite(q, HK_N)) return HK_NOT_FINITE;
  if (!hk_all_rotate(to)) return HK_NOT_A_ROTATION;
#ifdef HK_STRETCHES
  hk_rules rules = hk_ours;
  rules.side = context[HK_SIDE];
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_TARGET + HK_R; i++) x[HK_N + i] = i < HK_TARGET ? to[i] : context[HK_LEAF + i - HK_TARGET];
  if (how != HK_SHOWN && hk_go_within(region, &rules, x, q)) return hk_beyond_limits(q, context) ? HK_LIMIT : HK_REACHED;
#else
  (void)region;
#endif
  hk_pose_body(q, T);
  hk_unpack(T, from);
  hk_constraint_body(q, g);
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_TARGET; i++) x[HK_N + i] = from[i];
  for (int i = 0; i < HK_R; i++) x[HK_N + HK_TARGET + i] = g[i];
  hk_leaf_body(x, y);
  if (!(y[HK_N] > hk_ours.singular && y[HK_N + 1] > hk_ours.representation)) return HK_AT_SINGULAR;
  if (!(y[HK_N + 2] * context[HK_SIDE] > 0.0)) return HK_OTHER_BRANCH;
  return hk_answer(q, from, g, to, context, context[HK_TURN] == HK_INF ? how : HK_SHOWN);
}

/* The same; 0 where a last row is not that of a pose, as of a transposed one. */
static int hk_read(const double *T, double *to) {
  hk_unpack(T, to);
  return hk_posed(T, 16 * HK_FRAMES);
}

/* For a call from Python, evaluator.c: 1 where the poses in[0], (4, 4) each, are reached; near in[1] in the second, which has a
   region for each thread, of its last call. */
int hk_call_cold(const double *const *in, double *const *out, const double *context) {
  double to[HK_TARGET];
  return hk_read(in[0], to) && hk_cold(to, context, HK_QUICK, out[0]) == HK_REACHED;
}

/* The same: 1 where no posture of the arm has the pose. */
int hk_call_nowhere(const double *const *in, double *const *out, const double *context) {
  double to[HK_TARGET];
  *out[0] = 1.0;
  return hk_read(in[0], to) && hk_finite(to, HK_TARGET) && hk_all_rotate(to) && hk_nowhere(to, context + HK_START);
}

int hk_call_warm(const double *const *in, double *const *out, const double *context) {
  static __thread hk_region last;
  double to[HK_TARGET];
  for (int i = 0; i < HK_N; i++) out[0][i] = in[1][i];
  return hk_read(in[0], to) && hk_warm(to, context, HK_BOTH, &last, out[0]) == HK_REACHED;
}

/* Many poses (count, HK_TARGET), p and R: q (count, HK_N) has the postures to begin from where `warm`, and gets those where
   the ways ended. shown: in pieces that are shown to keep to the branch alone. */
void hk_poses(long long count, const double *to, const double *context, int warm, int shown, double *q, long long *status) {
  const int how = shown ? HK_SHOWN : HK_BOTH;
  hk_region region;
  memset(&region, 0, sizeof region);
  for (long long k = 0; k < count; k++) {
    const double *target = to + HK_TARGET * k;
    double *here = q + k * HK_N;
    status[k] = warm ? hk_warm(target, context, how, &region, here) : hk_cold(target, context, how, here);
  }
}
