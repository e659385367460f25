/* Inverse kinematics on a leaf: a way gone in stretches that are shown to keep to one branch, and in the pieces of newton.c
   where they cannot be.
   hk_go: from the posture q, at a share of the way; 0 at its end, 1 where it could not go on, 2 where it took too many pieces, 3 where it comes to
   a fold. q becomes the posture there; x is for (q, p, R, c). */
static int hk_go(const hk_way *way, const hk_rules *rules, hk_t share, hk_t *q, hk_t *x) {
  hk_t width, rate[HK_N];
  hk_fold fold = {HK_C(0), HK_C(0), HK_C(0), HK_C(0), 0, 0};
  hk_branch branch;
#ifdef HK_RAYS
  if (hk_on_ray(way, q)) return hk_go_ray(way, rules, q, x);
  if (hk_leap(way, rules, q, x)) return 0;
#endif
#ifdef HK_STRETCHES
  share = hk_go_stretches(way, rules, share, &fold, q, x);
  if (fold.found) return 3;
#endif
  branch.laid = 0;
  branch.length = HK_C(HK_LONGEST);
  width = HK_C(1) - share;
  for (int i = 0; i < HK_N; i++) rate[i] = HK_C(0);
  for (int tried = 0; share < HK_C(1); tried++) {
    const hk_t goal = HK_FMIN(HK_C(1), share + width), from = share;
    if (tried >= rules->tries) return 2;
    hk_aim(way, goal, x);
    const hk_t fits = hk_piece(x, q, rate, goal - share, HK_C(0), way->turn, &branch, rules);
    width = fits * (goal - share);
    if (fits >= HK_C(1) || (fits < HK_C(0) && goal == HK_C(1)))
      share = goal;
    else if (!(width >= rules->smallest))
      return 1;
    if (share > from && share < HK_C(1) && hk_fold_ahead(&fold, way, (from + share) / HK_C(2), share, rate, rules, q, x)) return 3;
  }
  return 0;
}
