/* 1 where no posture of the arm has a tool pose (p, R): motion/ik/arm_reach.py. hk_first_body takes (the held joint's value,
   the pose by rows) and says how real the root of the first step is, below 0 where there is none. It is looked at over a
   whole turn, first where the start has that joint. */
static int hk_nowhere(const double *to, const double *start) {
#ifdef HK_REACH
  double x[17], real, first = 0.0, last = 0.0, most = -HUGE_VAL, change = 0.0, *pose = x + (HK_REACH_HELD >= 0);
  for (int i = 0; i < 16; i++) pose[i] = i >= 12 ? i == 15 : i % 4 == 3 ? to[i / 4] : to[3 + i / 4 * 3 + i % 4];
  for (int k = 0; k < HK_REACH_VALUES; k++) {
    if (HK_REACH_HELD >= 0) x[0] = start[HK_REACH_HELD < 0 ? 0 : HK_REACH_HELD] + 6.283185307179586 * k / HK_REACH_VALUES;
    hk_first_body(x, &real);
    if (!(real < -HK_REACH_SURELY)) return 0;
    if (!k) first = last = real;
    most = HK_FMAX(real, most);
    change = HK_FMAX(HK_FABS(real - last), change);
    last = real;
  }
  change = HK_FMAX(HK_FABS(last - first), change);
  return most + change / 2 < -HK_REACH_SURELY;
#else
  (void)to, (void)start;
  return 0;
#endif
}
