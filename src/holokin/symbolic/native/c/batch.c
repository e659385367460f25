/* hk_body over many samples, HK_LANES at a time. X[a] (count, hk_in[a]), one sample a row; an argument that does not vary
   has stride 0. It is called so many times for each, its first HK_FED results the first arguments of the next call:
   Y[b] (count, times, hk_out[b]). */
void hk_batch(long long count, const double *const *X, const long long *strides, double *const *Y, long long times) {
  hk_t x[HK_NX], y[HK_NY];
  for (long long i = 0; i < count; i += HK_LANES) {
    const int lanes = count - i < HK_LANES ? (int)(count - i) : HK_LANES;
    for (int a = 0, k = 0; a < HK_INPUTS; k += hk_in[a], a++)
      for (int l = 0; l < HK_LANES; l++) {
        const double *row = X[a] + (i + (l < lanes ? l : 0)) * strides[a];
        for (int j = 0; j < hk_in[a]; j++) x[k + j][l] = row[j];
      }
    for (long long t = 0; t < times; t++) {
      hk_body(x, y);
      for (int b = 0, k = 0; b < HK_OUTPUTS; k += hk_out[b], b++)
        for (int l = 0; l < lanes; l++) {
          double *row = Y[b] + ((i + l) * times + t) * hk_out[b];
          for (int j = 0; j < hk_out[b]; j++) row[j] = y[k + j][l];
        }
      for (int a = 0, k = 0; a < HK_FED; k += hk_in[a], a++)
        for (int j = k; j < k + hk_in[a]; j++) x[j] = y[j];
    }
  }
}
