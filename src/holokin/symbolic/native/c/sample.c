/* hk_body at one sample. in[a]: the numbers of argument a, one row after another; out[b]: where result b goes; context: of no use here.
   Outputs beyond the results are measures, single numbers that must be above their bounds.
   Returns 1, or 0 where a figure is not or, with HK_FINITE, an argument or a result is not finite. */
HK_API int hk_sample(const double *const *in, double *const *out, const double *context) {
  hk_t x[HK_NX], y[HK_NY];
  int sound = 1, k = 0;
  (void)context;
  for (int a = 0; a < HK_INPUTS; a++)
    for (int j = 0; j < hk_in[a]; j++) x[k++] = in[a][j];
  for (int i = 0; HK_FINITE && i < k; i++) sound &= x[i] - x[i] == HK_C(0);
  if (!sound) return 0;
  hk_body(x, y);
  k = 0;
  for (int b = 0; b < HK_RESULTS; b++)
    for (int j = 0; j < hk_out[b]; j++) out[b][j] = y[k++];
  for (int i = 0; HK_FINITE && i < k; i++) sound &= y[i] - y[i] == HK_C(0);
  for (int f = 0; f < HK_FIGURES; f++) sound &= y[k + f] > hk_bounds[f];
  return sound;
}
