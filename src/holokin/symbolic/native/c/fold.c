/* Folds: where a leaf ends, and the way with it. Ahead of one the joints go like the square root of the share of the way
   that is left, so that 1 / |q'|^2 falls evenly, and is 0 there: two rates tell where. Of a way that passes close by one,
   the place moves on by a quarter of what has been gone (or by half, past a posture about which joints spin).
   A way is given up where the place stands still until 4^-SURE of the share is left; the posture is then led on while
   Newton's method converges, to 4^-CLOSER at least. It is a judgement, no proof: it refuses poses, and answers none. */
enum { HK_SURE = 4, HK_CLOSER = 7 };

typedef struct {
  hk_t share, slack, at, first;
  int found, agreed;
} hk_fold;

/* Take in the joints' rate at a share: 1 where the fold that it shows has moved by at most so much of what was gone. */
static int hk_fold_agrees(hk_fold *fold, hk_t share, const hk_t *rate, hk_t most) {
  const hk_t slack = HK_C(1) / hk_dot(rate, rate), gone = share - fold->share, fall = fold->slack - slack;
  const hk_t at = share + gone * (slack / fall);
  const int agrees = fall > HK_C(0) && at > share && HK_FABS(at - fold->at) <= most * gone;
  fold->share = share, fold->slack = slack, fold->at = at;
  return agrees;
}

/* Look for a fold ahead of q, which is at a share of the way, by the joints' rate there, or in the middle of what led
   there. 1 where there is one before the way's end: q then lies close to it. x is for (q, p, R, c). */
static int hk_fold_ahead(hk_fold *fold, const hk_way *way, hk_t middle, hk_t share, const hk_t *rate, const hk_rules *rules,
                         hk_t *q, hk_t *x) {
  hk_t at[HK_N], y[HK_N + 3], margin;
  const int agrees = hk_fold_agrees(fold, middle, rate, HK_C(0.25));
  fold->agreed = agrees ? fold->agreed + 1 : 0;
  if (!agrees) fold->first = fold->slack;
  if (fold->agreed < 2 || fold->slack > HK_C(0.5) * fold->first) return 0;
  if (!(fold->at > share && HK_C(2) * fold->at - share < HK_C(1))) return 0;
  hk_fold near = *fold;
  fold->first = fold->slack; /* the next look, if any, where this has halved again */
  for (int i = 0; i < HK_N; i++) at[i] = q[i];
  for (int k = 0; k <= HK_CLOSER; k++) { /* to q at first, then to a quarter of the share left, by half of the motion */
    const hk_t left = k ? near.at - share : HK_C(0);
    share += HK_C(0.75) * left;
    for (int i = 0; i < HK_N; i++) x[i] = at[i] + (k ? left * y[i] : HK_C(0));
    hk_aim(way, share, x);
    if (!hk_newton(x, rules, &margin)) {
      if (k > HK_SURE) break;
      return 0;
    }
    for (int i = 0; i < HK_N; i++) at[i] = x[i];
    const hk_t ahead = HK_C(0.001) * (near.at - share);
    hk_aim(way, share + ahead, x);
    hk_leaf_body(x, y); /* the joints' rate */
    for (int i = 0; i < HK_N; i++) y[i] /= ahead;
    if (k && !hk_fold_agrees(&near, share, y, HK_C(k > 1 ? 0.1 : 0.25))) return 0;
    near.share = share, near.slack = HK_C(1) / hk_dot(y, y);
  }
  for (int i = 0; i < HK_N; i++) q[i] = at[i];
  fold->found = 1;
  return 1;
}
