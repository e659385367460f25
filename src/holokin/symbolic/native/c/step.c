/* One control step. hk_step_body takes (q, pose, twist, parameters) and gives (dq, scale, rcond, margin, room, off,
   given, holding): room is the scale that positions allow, off the tool's largest error, given is finite where all
   arguments are, holding the sum of 2^i over the joints i at a position limit, which would go beyond it.
   pose and twist: where the tool is wanted at the end of the step, 16 numbers, a 4x4 matrix by rows, or 3, a position;
   and the twist that leads there, 6 numbers, or 3, a velocity. parameters: the leaf c, its rate, dt, the gain, the constraint
   gain, the most error and the least rcond. out: dq, the scale, holding.
   Returns 0 as wanted, 1 slowed for a speed limit, 2 held at a position limit, 3 singular, 4 not finite, 8 lost: the
   tool's error is larger than the most; from 3 on dq is zero. */
HK_API int hk_step(const hk_t *q, const hk_t *pose, const hk_t *twist, hk_t *out, const hk_t *parameters) {
  enum { size = HK_N + HK_POSE + HK_TWIST + HK_PARAMETERS };
  hk_t x[size], y[HK_N + 7];
  int finite = 1;
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_POSE; i++) x[HK_N + i] = pose[i];
  for (int i = 0; i < HK_TWIST; i++) x[HK_N + HK_POSE + i] = twist[i];
  for (int i = 0; i < HK_PARAMETERS; i++) x[HK_N + HK_POSE + HK_TWIST + i] = parameters[i];
  hk_step_body(x, y);
  for (int i = 0; i < HK_N + 1; i++) finite &= y[i] - y[i] == HK_C(0);
  const hk_t *const bounds = parameters + HK_PARAMETERS - 2;
  const int sound = HK_SOUND(y[HK_N + 1], y[HK_N + 2]) && y[HK_N + 1] > bounds[1];
  const int given = y[HK_N + 5] - y[HK_N + 5] == HK_C(0), near = y[HK_N + 4] <= bounds[0];
  if (!finite || !sound || !given || !near) {
    for (int i = 0; i < HK_N + 2; i++) out[i] = HK_C(0);
    return !given ? 4 : finite && sound ? 8 : 3;
  }
  for (int i = 0; i < HK_N + 1; i++) out[i] = y[i];
  out[HK_N + 1] = y[HK_N + 6];
#ifdef HK_IMPRECISE
  if (hk_rough(y[HK_N + 1], y[HK_N + 2])) return HK_IMPRECISE;
#endif
  if (y[HK_N] >= HK_C(1)) return 0;
  return y[HK_N + 3] > HK_C(HK_AT_LIMIT) ? 1 : 2;
}
