/* Down to the posture of a leaf that is nearest to a wanted pose, from the looks and steps of edge.c. */

/* The eigenvalues of a symmetric H and its eigenvectors, the columns of V, by Jacobi's rotations. [GVL13, section 8.5] */
static void hk_eigen(hk_t *H, hk_t *V) {
  for (int i = 0; i < HK_M * HK_M; i++) V[i] = i % (HK_M + 1) ? HK_C(0) : HK_C(1);
  for (int sweep = 0; sweep < 12; sweep++) {
    hk_t off = HK_C(0), all = HK_C(0);
    for (int i = 0; i < HK_M; i++)
      for (int j = 0; j < HK_M; j++) {
        all += H[i * HK_M + j] * H[i * HK_M + j];
        if (i != j) off += H[i * HK_M + j] * H[i * HK_M + j];
      }
    if (!(off > HK_C(1e-28) * all)) return;
    for (int p = 0; p < HK_M; p++)
      for (int q = p + 1; q < HK_M; q++) {
        const hk_t a = H[p * HK_M + q];
        if (a == HK_C(0)) continue;
        const hk_t half = (H[q * HK_M + q] - H[p * HK_M + p]) / (HK_C(2) * a);
        const hk_t t = HK_COPYSIGN(HK_C(1), half) / (HK_FABS(half) + HK_SQRT(HK_C(1) + half * half));
        const hk_t c = HK_C(1) / HK_SQRT(HK_C(1) + t * t), s = t * c;
        for (int k = 0; k < HK_M; k++) {
          const hk_t u = H[k * HK_M + p], v = H[k * HK_M + q];
          H[k * HK_M + p] = c * u - s * v, H[k * HK_M + q] = s * u + c * v;
        }
        for (int k = 0; k < HK_M; k++) {
          const hk_t u = H[p * HK_M + k], v = H[q * HK_M + k];
          H[p * HK_M + k] = c * u - s * v, H[q * HK_M + k] = s * u + c * v;
        }
        for (int k = 0; k < HK_M; k++) {
          const hk_t u = V[k * HK_M + p], v = V[k * HK_M + q];
          V[k * HK_M + p] = c * u - s * v, V[k * HK_M + q] = s * u + c * v;
        }
      }
  }
}

/* The inverse of the second derivative by z of |e|^2 / 2 - force c, made positive definite. */
static HK_CALL void hk_compliance(const hk_edge *edge, const hk_look *at, const hk_t *force, const hk_t *goal, hk_t *M) {
  hk_t H[HK_M * HK_M], V[HK_M * HK_M], pull[HK_M], size = HK_C(0);
  hk_look there;
  for (int i = 0; i < HK_M; i++) {
    pull[i] = at->e[i];
    for (int k = 0; k < at->count; k++) pull[i] += force[k] * at->A[k * HK_M + i];
  }
  for (int j = 0; j < HK_M; j++) {
    hk_t q[HK_N];
    for (int i = 0; i < HK_N; i++) q[i] = at->q[i] + HK_C(HK_EDGE_SPREAD) * at->S[i * HK_M + j];
    hk_look_at(edge, q, goal, at, &there);
    for (int i = 0; i < HK_M; i++) {
      hk_t more = pull[i] - there.e[i];
      for (int k = 0; k < at->count; k++) more -= force[k] * there.A[k * HK_M + i];
      V[i * HK_M + j] = more / HK_C(HK_EDGE_SPREAD);
    }
  }
  for (int i = 0; i < HK_M; i++)
    for (int j = 0; j < HK_M; j++) {
      H[i * HK_M + j] = (V[i * HK_M + j] + V[j * HK_M + i]) / HK_C(2);
      size += H[i * HK_M + j] * H[i * HK_M + j];
    }
  size = HK_C(10) * HK_SQRT(size); /* what it adds changes nothing while the constraints are held */
  for (int k = 0; k < at->count; k++)
    for (int i = 0; i < HK_M && force[k] > HK_C(0); i++)
      for (int j = 0; j < HK_M; j++) H[i * HK_M + j] += size * at->A[k * HK_M + i] * at->A[k * HK_M + j];
  hk_eigen(H, V);
  for (int i = 0; i < HK_M; i++)
    for (int j = 0; j < HK_M; j++) {
      M[i * HK_M + j] = HK_C(0);
      for (int k = 0; k < HK_M; k++)
        M[i * HK_M + j] += V[i * HK_M + k] * V[j * HK_M + k] / HK_FMAX(H[k * HK_M + k], HK_C(HK_EDGE_CURVED));
    }
}

/* The least ratio of a step to how far its joint is from its beginning: below 1 one is farther than a step. */
static hk_t hk_least_ratio(const hk_t *q, const hk_t *begin, const hk_t *step) {
  hk_t room = HK_INF;
  for (int i = 0; i < HK_N; i++) room = HK_FMIN(step[i] / HK_FMAX(HK_FABS(q[i] - begin[i]), HK_C(1e-300)), room);
  return room;
}

/* Along a motion of the tool as far as no joint goes farther from its beginning than a step; 0 for nowhere. */
static int hk_part(const hk_edge *edge, const hk_look *at, const hk_t *z, hk_t share, const hk_t *goal, int careful,
                    const hk_t *begin, const hk_t *step, hk_look *best) {
  hk_t low = HK_C(0), high = HK_C(2) * share;
  hk_look there;
  for (int tried = 0; tried < HK_EDGE_HALVINGS; tried++) {
    hk_t ratio = HK_C(0);
    if (hk_moved(edge, at, z, share, goal, careful, &there) && hk_inside(edge, &there, goal, careful))
      ratio = hk_least_ratio(there.q, begin, step);
    if (ratio >= HK_C(1)) {
      *best = there;
      low = share;
      if (ratio <= HK_C(HK_EDGE_AMPLE) || share >= HK_C(1)) break;
    } else
      high = share;
    share = HK_FMIN(HK_C(1), HK_C(0.99) * ratio * share);
    if (!(share > low && share < high)) share = (low + high) / HK_C(2);
  }
  return low > HK_C(0);
}

/* Leads a look within the constraints down to the end of its way. With a step, 1 where that takes more than one from
   its beginning, and `cut` is how far one leads. least: share of the distance below which a step along the edge is not
   worth it. */
static int hk_descend(const hk_edge *edge, hk_look *at, const hk_t *goal, int careful, const hk_t *begin, const hk_t *step,
                      hk_look *cut, hk_t least) {
  hk_t M[HK_M * HK_M], z[HK_M], further[HK_M], force[HK_MOST_HELD], forces[HK_MOST_HELD];
  hk_t trust = HK_C(HK_EDGE_TRUST);
  int fresh = 0, is_cut = 0, curved = 0;
  hk_look there, safe = *at;
  hk_project(at, at->e, 0, z, force);
  for (int done = 0; done < HK_EDGE_STEPS; done++) {
    hk_t most = -HK_INF, weight = HK_C(0);
    if (!fresh) {
      for (int k = 0; k < at->count; k++)
        if (force[k] > HK_C(0)) most = HK_FMAX(at->c[k], most);
      curved = fresh = most > -HK_INF && most <= HK_C(HK_EDGE_TIGHT);
      if (curved) hk_compliance(edge, at, force, goal, M);
      hk_project(at, at->e, curved ? M : 0, z, force);
    }
    const hk_t size = HK_SQRT(hk_times(z, z, HK_M));
    for (int k = 0; k < at->count; k++) weight += HK_C(2) * force[k];
    const hk_t small = weight > HK_C(0) ? least * hk_distance(at) : HK_C(0);
    if (!(size > HK_FMAX(HK_C(HK_EDGE_DONE), small))) break;
    const hk_t *along = weight > HK_C(0) ? z : 0;
    hk_t share = HK_FMIN(HK_C(1), trust / size), ratio = HK_C(0);
    int good = 0;
    for (; share * size > HK_C(HK_EDGE_DONE); share /= HK_C(2)) {
      const hk_t hoped = HK_C(HK_EDGE_DESCENT) * share * hk_times(at->e, z, HK_M), before = hk_merit(at, weight);
      if (!hk_moved(edge, at, along, share, goal, careful, &there)) continue;
      if (hk_excess(&there) > HK_C(HK_EDGE_NEAR) || before - hk_merit(&there, weight) < hoped) {
        const int little = size <= HK_C(HK_EDGE_SMALL) && hk_excess(&there) <= HK_C(HK_EDGE_NEAR);
        if (!little && !hk_inside(edge, &there, goal, careful)) continue;
      }
      hk_project(&there, there.e, curved ? M : 0, further, forces);
      ratio = HK_SQRT(hk_times(further, further, HK_M)) / size;
      good = before - hk_merit(&there, weight) >= hoped ||
             (size <= HK_C(HK_EDGE_SMALL) && share == HK_C(1) && ratio <= HK_C(HK_EDGE_CONTRACTION));
      if (good) break;
    }
    if (!good) break;
    if (step && !is_cut && hk_least_ratio(there.q, begin, step) < HK_C(1)) {
      if (!hk_part(edge, at, along, share, goal, careful, begin, step, cut)) *cut = safe;
      is_cut = 1;
    }
    *at = there;
    for (int i = 0; i < HK_M; i++) z[i] = further[i];
    for (int k = 0; k < at->count; k++) force[k] = forces[k];
    fresh = fresh && ratio <= HK_C(HK_EDGE_FAST) && share == HK_C(1);
    trust = HK_C(2) * HK_FMAX(share * size, HK_C(HK_EDGE_TRUST) / HK_C(4));
    if (hk_excess(at) <= HK_C(HK_EDGE_WITHIN)) safe = *at;
  }
  if (!hk_inside(edge, at, goal, careful)) *at = safe;
  return is_cut;
}

/* 1 where the straight way of the tool between two postures is shown to lead from one to the other on the branch. */
static int hk_joined(const hk_edge *edge, const hk_t *q, const hk_t *tool, const hk_look *end) {
  hk_way way;
  hk_t x[HK_N];
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  hk_straight(edge, tool, end->tool, &way);
  if (!hk_walked(edge, x, &way, HK_EDGE_FEW)) return 0;
  for (int i = 0; i < HK_N; i++)
    if (!(HK_FABS(x[i] - end->q[i]) <= HK_C(HK_EDGE_SAME))) return 0;
  return 1;
}

/* Down from a look, which may be outside, to the posture nearest to a goal, or as far as a step leads: 0, or 1 where the
   step cut it short; -1 where it is not shown to be on the branch of a posture q. careful: each piece is shown to keep to
   the branch; else Newton steps alone lead down, and the straight way from q to the end is. */
static int hk_down(const hk_edge *edge, hk_look *at, const hk_t *goal, int careful, const hk_t *q, const hk_t *tool,
                   const hk_t *step, hk_look *cut) {
  if (!hk_inside(edge, at, goal, careful)) return -1;
  const int is_cut = hk_descend(edge, at, goal, careful, q, step, cut, HK_C(0));
  return careful || hk_joined(edge, q, tool, is_cut ? cut : at) ? is_cut : -1;
}

/* The straight way from the start to a goal; 1 where it is gone to its end, within the constraints. */
static int hk_from_start(const hk_edge *edge, const hk_t *goal, int careful, hk_look *at) {
  hk_t q[HK_N];
  hk_way way;
  hk_straight(edge, edge->tool, goal, &way);
  for (int i = 0; i < HK_N; i++) q[i] = edge->start[i];
  const int reached = careful ? hk_walked(edge, q, &way, edge->rules.tries) : hk_glance(edge, q, &way);
  hk_look_at(edge, q, goal, 0, at);
  return reached && hk_excess(at) <= HK_C(HK_EDGE_WITHIN);
}

/* The same: what a glance does not reach is not reached; what it does reach is shown, but where that is the posture `near`
   (or 0), which is found in another way. Where it cannot be shown, the look is at the start. */
static int hk_reaches(const hk_edge *edge, const hk_t *goal, const hk_t *near, hk_look *at) {
  int agrees = near != 0;
#ifdef HK_RAYS
  int ray = 1;
  for (int i = 0; i < HK_N; i++) ray &= edge->start[i] == hk_center[i];
  if (ray) return hk_from_start(edge, goal, 1, at); /* in Newton steps anyway */
#endif
  if (!hk_from_start(edge, goal, 0, at)) return 0;
  for (int i = 0; i < HK_N && agrees; i++) agrees = HK_FABS(at->q[i] - near[i]) <= HK_C(HK_EDGE_SAME);
  if (agrees || hk_from_start(edge, goal, 1, at)) return 1;
  hk_look_at(edge, edge->start, goal, 0, at);
  return 0;
}

static int hk_at_goal(const hk_look *at) { return hk_distance(at) <= HK_C(HK_EDGE_REACHED); }

/* 1 where the way down leads to a goal from where the straight way from the start ends. */
static int hk_slides(const hk_edge *edge, const hk_t *goal, hk_look *at) {
  if (hk_inside(edge, at, goal, 0)) hk_descend(edge, at, goal, 0, edge->start, 0, 0, HK_C(HK_EDGE_ALONG));
  return hk_at_goal(at) && hk_excess(at) <= HK_C(HK_EDGE_WITHIN) && hk_joined(edge, edge->start, edge->tool, at);
}

/* From the start alone. */
static void hk_nearest_cold(const hk_edge *edge, const hk_t *goal, hk_look *at) {
  if (hk_reaches(edge, goal, 0, at) || hk_down(edge, at, goal, 0, edge->start, edge->tool, 0, 0) >= 0) return;
  hk_look_at(edge, edge->start, goal, 0, at);
  hk_descend(edge, at, goal, 1, edge->start, 0, 0, HK_C(0));
}

/* How many steps the joints are from a to b. */
static hk_t hk_steps(const hk_t *a, const hk_t *b, const hk_t *step) { return HK_C(1) / hk_least_ratio(b, a, step); }

/* From q straight towards a posture, as far as a step allows. */
static void hk_limited(const hk_t *q, const hk_t *end, const hk_t *step, hk_t *there) {
  const hk_t share = HK_FMIN(HK_C(1), hk_least_ratio(end, q, step));
  for (int i = 0; i < HK_N; i++) there[i] = q[i] + share * (end[i] - q[i]);
}

/* Where q, or `begin` on the leaf, if there is one, is to go: 1 where the joints belong, which the start tells; else 0, down
   to the nearest pose, and is_cut where a step leads only to `cut` on that way. */
static int hk_whither(const hk_edge *edge, const hk_t *goal, const hk_t *q, const hk_look *begin, const hk_t *step,
                      hk_look *end, hk_look *cut, int *is_cut) {
  hk_t x[HK_STATE];
  hk_look at;
  *is_cut = -1;
  if (hk_reaches(edge, goal, hk_solved(edge, q, goal, x) ? x : 0, end)) return 1;
  at = *end;
  for (int careful = 0; careful < 2 && begin && *is_cut < 0; careful++) {
    *end = *begin;
    *is_cut = hk_down(edge, end, goal, careful, begin->q, begin->tool, step, cut);
  }
  if (*is_cut < 0) {
    hk_nearest_cold(edge, goal, end);
    return 1;
  }
  if (hk_at_goal(end) || !hk_slides(edge, goal, &at)) return 0;
  *end = at;
  return 1;
}

/* From q, each joint by at most a step where one is given: 1 where that cut it short. */
static int hk_nearest_warm(const hk_edge *edge, const hk_t *goal, const hk_t *q, const hk_t *step, hk_look *at) {
  hk_look begin, cut, straight;
  hk_t there[HK_N];
  int is_cut;
  const int on = hk_onto(edge, q, goal, &begin), belongs = hk_whither(edge, goal, q, on ? &begin : 0, step, at, &cut, &is_cut);
  if (!step || hk_least_ratio(at->q, q, step) >= HK_C(1)) return 0;
  if (belongs && on) {
    for (int i = 0; i < HK_N; i++) there[i] = begin.q[i] + hk_times(begin.S + i * HK_M, begin.e, HK_M);
    const hk_t share = HK_FMIN(HK_C(1), hk_least_ratio(there, begin.q, step));
    is_cut = hk_part(edge, &begin, 0, share, goal, 1, begin.q, step, &cut);
  }
  hk_limited(q, at->q, step, there);
  hk_look_at(edge, there, goal, 0, &straight);
  if (is_cut > 0) {
    hk_limited(q, cut.q, step, there);
    hk_look_at(edge, there, goal, 0, &cut);
    const hk_t gone = belongs ? hk_steps(q, at->q, step) - hk_steps(there, at->q, step) : hk_steps(q, there, step);
    const int enough = gone >= HK_C(HK_EDGE_LEAST);
    if (enough || (!belongs && hk_distance(&straight) + hk_excess(&straight) >= hk_distance(&cut))) {
      *at = cut;
      return enough;
    }
  }
  *at = straight;
  return 1;
}

/* The posture nearest to a goal (p, R), from the start, or from q where there is one. context: as of poses.c, then the
   length and the margin. out: (q, e, rcond, p, R, how far each constraint is). As hk_nearest_warm; 2 where the goal is
   not finite, 3 where it has no rotation. */
HK_API int hk_nearest_to(const hk_t *context, const hk_t *goal, const hk_t *q, const hk_t *step, hk_t *out) {
  static const hk_rules ours = HK_RULES;
  const hk_t *level = context + HK_N + 12, *lower = level + HK_R, *upper = lower + HK_N, *rest = upper + HK_N;
  hk_edge edge = {context, context + HK_N, level, lower, upper, rest[1], rest[2], ours};
  hk_look at;
  int moving = 0;
  for (int i = 0; i < 12; i++)
    if (!(goal[i] - goal[i] == HK_C(0))) return 2;
  if (!hk_rotates(goal + 3)) return 3;
  edge.rules.side = rest[0];
  if (q)
    moving = hk_nearest_warm(&edge, goal, q, step, &at);
  else
    hk_nearest_cold(&edge, goal, &at);
  for (int i = 0; i < HK_N; i++) *out++ = at.q[i];
  for (int i = 0; i < HK_M; i++) *out++ = at.e[i];
  *out++ = at.rcond;
  for (int i = 0; i < 12; i++) *out++ = at.tool[i];
  for (int i = 0; i < HK_MOST_HELD; i++) out[i] = HK_INF;
  for (int k = 0; k < at.count; k++) out[at.which[k]] = at.c[k];
  return moving;
}
