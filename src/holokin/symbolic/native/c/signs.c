/* hk_body for all signs of its last argument, HK_SIGNS numbers 1 or -1, the first of which changes slowest: at one sample
   of the other arguments, in[a], each one row after another. out: a row of HK_NY results for each choice of signs. */
static void hk_all_signs(const double *const *in, double *out) {
  hk_t x[HK_NX], y[HK_NY];
  int k = 0;
  for (int a = 0; a < HK_INPUTS - 1; a++)
    for (int j = 0; j < hk_in[a]; j++) x[k++] = hk_all(in[a][j]);
  for (int first = 0; first < 1 << HK_SIGNS; first += HK_LANES) {
    for (int s = 0; s < HK_SIGNS; s++)
      for (int l = 0; l < HK_LANES; l++) x[k + s][l] = (first + l) >> (HK_SIGNS - 1 - s) & 1 ? -1.0 : 1.0;
    hk_body(x, y);
    for (int l = 0; l < HK_LANES && first + l < 1 << HK_SIGNS; l++)
      for (int j = 0; j < HK_NY; j++) out[(first + l) * HK_NY + j] = y[j][l];
  }
}

int hk_sample(const double *const *in, double *const *out, const double *context) {
  (void)context;
  hk_all_signs(in, out[0]);
  return 1;
}

/* The same at many samples, as hk_batch has them, once. */
void hk_batch(long long count, const double *const *X, const long long *strides, double *const *Y, long long times) {
  const double *in[HK_INPUTS];
  (void)times;
  for (long long i = 0; i < count; i++) {
    for (int a = 0; a < HK_INPUTS - 1; a++) in[a] = X[a] + i * strides[a];
    hk_all_signs(in, Y[0] + (i << HK_SIGNS) * HK_NY);
  }
}
