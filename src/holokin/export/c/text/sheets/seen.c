  static const double S[12][12] = {
${rows}
  };
  double given_at[12];
  for (int i = 0; i < 12; i++) given_at[i] = at[i], at[i] = 0.0;
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) at[j] += given_at[i] * S[i][j];
