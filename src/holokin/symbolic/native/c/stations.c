/* An arm that is led to a pose from stations of sheets: motion/ik/stations.py. After the numbers of poses.c a context has: how
   many sheets S there are and sampled poses P; the first axis, a point of it, the hand's place in the tool (R, p) and what
   its axes count [m]; of the joints the limits, the middle of the ranges and the turn, infinite where it is another posture;
   of each sampled pose its arrows (4, 3), how far they go along the axis (4,) and half their square; of each sheet the rule
   (28,) and the sign of det; the stations (S, P, n), not a number where there is none. */
typedef struct {
  double near, cosine, sine;
  int place;
} hk_station;

/* The arrows of a hand (4, 3), and its axes as columns of R, of a tool pose by rows. */
static void hk_arrows(const double *pose, const double *point, const double *hand, double *v, double *R) {
  for (int i = 0; i < 3; i++) {
    v[i] = pose[4 * i + 3] - point[i];
    for (int j = 0; j < 3; j++) {
      R[3 * i + j] = pose[4 * i] * hand[j] + pose[4 * i + 1] * hand[3 + j] + pose[4 * i + 2] * hand[6 + j];
      v[i] -= R[3 * i + j] * hand[9 + j];
      v[3 + 3 * j + i] = hand[12] * R[3 * i + j];
    }
  }
}

/* The sampled poses that come nearest to arrows when they are turned about the axis, the nearest first; how many. */
static int hk_nearest_places(const double *v, const double *axis, const double *places, int count, hk_station *found) {
  double along[4], across[12], turned[12];
  int many = 0;
  for (int a = 0; a < 4; a++) {
    const double *x = v + 3 * a;
    along[a] = x[0] * axis[0] + x[1] * axis[1] + x[2] * axis[2];
    for (int i = 0; i < 3; i++) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      across[3 * a + i] = x[i] - along[a] * axis[i];
      turned[3 * a + i] = x[j] * axis[k] - x[k] * axis[j];
    }
  }
  for (int p = 0; p < count; p++, places += 17) {
    hk_station one = {-places[16], 0.0, 0.0, p};
    for (int i = 0; i < 12; i++) one.cosine += places[i] * across[i], one.sine += places[i] * turned[i];
    for (int a = 0; a < 4; a++) one.near += places[12 + a] * along[a];
    one.near += sqrt(one.cosine * one.cosine + one.sine * one.sine);
    if (many == HK_NEAREST && !(one.near > found[many - 1].near)) continue;
    int at = many < HK_NEAREST ? many++ : HK_NEAREST - 1;
    for (; at > 0 && found[at - 1].near < one.near; at--) found[at] = found[at - 1];
    found[at] = one;
  }
  return many;
}

/* (pose, which sheet, below 0 for the first that serves, and a posture from which it is gone in place of the stations, if it
   is a number) -> (posture, how far within the limits, sheet); 0 where there is none. */
int hk_call_station(const double *const *in, double *const *out, const double *context) {
  const double *c = context + HK_TURN + 1, *axis = c + 2, *point = axis + 3, *hand = point + 3;
  const double *low = hand + 13, *high = low + HK_N, *middle = high + HK_N, *turn = middle + HK_N, *places = turn + HK_N;
  const int sheets = (int)c[0], count = (int)c[1], wanted = (int)in[1][0], given = hk_finite(in[1] + 1, HK_N);
  const double *rules = places + 17 * count, *stations = rules + 29 * sheets;
  double to[HK_TARGET], v[12], R[9], u[7] = {1.0}, own[HK_TURN + 1], *q = out[0];
  hk_station found[HK_NEAREST];
  if (!hk_read(in[0], to) || !hk_finite(to, HK_TARGET) || !hk_all_rotate(to)) return 0;
  hk_arrows(in[0], point, hand, v, R);
  for (int j = 0; j < 3; j++)
    for (int i = 0; i < 3; i++) u[1 + j] -= R[3 * i + j] * v[i], u[4 + j] += R[3 * i + j] * axis[i];
  const int many = hk_nearest_places(v, axis, places, count, found);
  memcpy(own, context, sizeof own);
  for (int s = wanted < 0 ? 0 : wanted; s < (wanted < 0 ? sheets : wanted + 1); s++) {
    const double *rule = rules + 29 * s;
    own[HK_LEAF] = 0.0;
    for (int i = 0; i < 7; i++)
      for (int j = i; j < 7; j++) own[HK_LEAF] += *rule++ * u[i] * u[j];
    own[HK_SIDE] = *rule;
    int reached = 0;
    for (int k = 0, tried = 0; k < many && tried < (given ? 1 : HK_STATION_TRIES) && !reached; k++) {
      const double *station = stations + ((size_t)s * count + found[k].place) * HK_N;
      if (!given && !(station[0] - station[0] == 0.0)) continue;
      double T[16 * HK_FRAMES + 2], from[HK_TARGET], g[HK_R + 1];
      for (int i = 0; i < HK_N; i++) q[i] = given ? in[1][1 + i] : station[i];
      if (!given) q[0] += atan2(found[k].sine, found[k].cosine);
      hk_pose_body(q, T);
      hk_unpack(T, from);
      hk_constraint_body(q, g);
      reached = hk_answer(q, from, g, to, own, HK_QUICK) == HK_REACHED;
      tried++;
    }
    if (!reached) continue;
    double margin = HK_STATION_FREE;
    for (int i = 0; i < HK_N; i++) {
      if (turn[i] < HUGE_VAL) q[i] -= turn[i] * rint((q[i] - middle[i]) / turn[i]);
      margin = fmin(margin, fmin(q[i] - low[i], high[i] - q[i]));
    }
    if (wanted < 0 && !(margin > HK_SERVES)) continue;
    q[HK_N] = margin;
    q[HK_N + 1] = s;
    return 1;
  }
  return 0;
}
