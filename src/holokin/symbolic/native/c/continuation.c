/* A way gone by numerical continuation [Deu04, section 5.1]: the cubic through the last two postures and their rates
   predicts the next one, two steps of Newton's method correct it. A step counts where the prediction is near, Newton's
   method contracts, [J; J_g] keeps its sign and is not nearly singular, and the motion agrees with the rates at its ends.
   About a fold the sign is another, and past a cusp, as of q^3 - a q, the motion is three times the rates. That shows it
   where formulas have no narrow bends: motion/ik/edge.py.
   hk_ahead_body takes (q, p, R, c, p', R', c') and gives (dq, dq', rcond, margin, sign of det), Newton's corrections towards
   two targets, whose difference is the joints' rate. */
#ifdef HK_CONTINUED
typedef struct {
  hk_t share, q[HK_N], rate[HK_N], rcond;
} hk_stand;

/* The posture predicted for a share of the way. */
static void hk_predict(const hk_stand *before, const hk_stand *last, hk_t share, hk_t *q) {
  const hk_t gone = last->share - before->share, ahead = share - last->share;
  for (int i = 0; i < HK_N; i++) {
    const hk_t move = last->q[i] - before->q[i], first = gone * before->rate[i], rate = gone * last->rate[i];
    const hk_t third = first + rate - HK_C(2) * move, second = HK_C(3) * (third + move) - HK_C(2) * first - rate;
    const hk_t u = gone > HK_C(0) ? ahead / gone : HK_C(0);
    q[i] = last->q[i] + (gone > HK_C(0) ? u * (rate + u * (second + u * third)) : ahead * last->rate[i]);
  }
}

/* From the prediction in next->q to the posture at next->share, with its rate: 1 where Newton's method finds it. At the end
   of the way it is exact. off: how far the prediction is from it. */
static int hk_correct(const hk_way *way, const hk_rules *rules, hk_t least, hk_stand *next, hk_t *off) {
  enum { TARGET = HK_TARGET + HK_R };
  const hk_t further = HK_C(1) / HK_C(131072);
  const int start = next->share == HK_C(0), end = next->share == HK_C(1);
  hk_t x[HK_N + 2 * TARGET], ahead[HK_N + TARGET], y[2 * HK_N + 3], before = HK_INF;
  hk_aim(way, next->share, x);
  hk_aim(way, next->share + further, ahead);
  for (int i = 0; i < TARGET; i++) x[HK_N + TARGET + i] = ahead[HK_N + i];
  for (int i = 0; i < HK_N; i++) x[i] = next->q[i];
  for (int k = 0; k < rules->most; k++) {
    const int rates = k == !start;
    const hk_t *measures = rates ? y + 2 * HK_N : y + HK_N;
    hk_t size = HK_C(0);
    if (rates)
      hk_ahead_body(x, y);
    else
      hk_leaf_body(x, y);
    int sound = measures[0] > least && measures[1] > rules->representation && measures[2] * rules->side > HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      sound &= y[i] - y[i] == HK_C(0);
      size = HK_FMAX(HK_FABS(y[i]), size);
      if (rates) next->rate[i] = (y[HK_N + i] - y[i]) / further;
    }
    if (!sound || !(size <= (k ? HK_FMAX(rules->contraction * before, rules->done) : HK_C(HK_OFF)))) return 0;
    for (int i = 0; i < HK_N; i++) x[i] += y[i];
    if (!k) *off = size;
    next->rcond = measures[0];
    before = size;
    if (k >= !start && (!end || size <= rules->done)) break;
  }
  for (int i = 0; i < HK_N; i++) next->q[i] = x[i];
  return !end || before <= rules->done;
}

/* 1 where the motion between two postures, of a share `width` apart, agrees with the joints' rates at both. fits: the share
   to try next, over this one. */
static int hk_agrees(const hk_stand *last, const hk_stand *next, hk_t width, hk_t *fits) {
  hk_t move = HK_C(0), bend = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    const hk_t moved = next->q[i] - last->q[i];
    move = HK_FMAX(HK_FABS(moved), move);
    bend = HK_FMAX(HK_FABS(moved - width * (last->rate[i] + next->rate[i]) / HK_C(2)), bend);
  }
  *fits = HK_SQRT(HK_C(0.5 * HK_BEND) * move / HK_FMAX(bend, HK_C(1e-12)));
  return bend <= HK_C(HK_BEND) * move + HK_C(1e-9) && move <= HK_C(1.5 * HK_STRIDE);
}

/* As far as the way can be gone so: its share, and q becomes the posture there. Where that is not the end, it is the
   farthest from a singular one of all that were met. */
static hk_t hk_continue(const hk_way *way, const hk_rules *rules, hk_t *q) {
  hk_t x[HK_N + HK_TARGET + HK_R], off, fits, width = HK_C(1);
  hk_stand before, last, next, best;
  int found = 1;
  last.share = HK_C(0);
  for (int i = 0; i < HK_N; i++) last.q[i] = q[i];
  if (!hk_correct(way, rules, rules->singular, &last, &off)) return HK_C(0);
  const hk_t least = HK_FMAX(rules->singular, HK_C(HK_SLACK) * last.rcond);
  before = best = last;
  for (int tried = 0; tried < HK_STRIDES && (found || width >= HK_C(HK_SHORTEST_STRIDE)); tried++) {
    /* As far as the joints move by a stride at their rates, and rcond falls to its half; the last two steps alike. */
    const hk_t left = HK_C(1) - last.share, first = last.share == HK_C(0);
    hk_t most = HK_C(1e-300);
    for (int i = 0; i < HK_N; i++) most = HK_FMAX(HK_FABS(last.rate[i]), most);
    width = HK_FMIN(width, HK_C(HK_STRIDE) / most * (first ? HK_C(0.5) : HK_C(1)));
    const hk_t fall = (before.rcond - last.rcond) / HK_FMAX(last.share - before.share, HK_C(1e-300));
    if (fall > HK_C(0)) width = HK_FMIN(width, HK_C(HK_FALL) * last.rcond / fall);
    if (left < HK_C(2) * width) width = left > width ? left / HK_C(2) : left;
    next.share = width < left ? last.share + width : HK_C(1);
    hk_predict(&before, &last, next.share, next.q);
    found = hk_correct(way, rules, HK_FMAX(least, HK_C(1 - HK_FALL) * last.rcond), &next, &off) &&
            hk_agrees(&last, &next, width, &fits);
    if (!found) {
      width *= HK_C(0.4);
      continue;
    }
    if (next.share == HK_C(1)) {
      for (int i = 0; i < HK_N; i++) q[i] = next.q[i];
      return HK_C(1);
    }
    /* What a prediction from two postures misses grows as the fourth power of the share, what motion and rates differ by,
       over the motion, as its square: the next step is to have half of what it may. */
    if (!first) fits = HK_FMIN(HK_SQRT(HK_SQRT(HK_C(0.5 * HK_OFF) / HK_FMAX(off, HK_C(1e-12)))), fits);
    width *= HK_FMAX(HK_C(0.4), HK_FMIN(HK_C(3), fits));
    before = last;
    last = next;
    if (next.rcond > best.rcond) best = next;
  }
  for (int i = 0; i < HK_N; i++) x[i] = best.q[i];
  hk_aim(way, best.share, x);
  if (!hk_newton(x, rules, &off)) return HK_C(0);
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  return best.share;
}
#endif
