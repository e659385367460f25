/* The sheets of an arm at a tool pose, HK_LANES rows side by side. hk_body: (pose (16), rule (HK_W), branch (HK_B)) ->
   (posture (HK_N), how real it is, how far within the limits, by how much the pose is none). hk_tool: posture -> pose (16).
   HK_W is 0 where nothing is held; HK_SLIDE: the rule is a value, not a vector along an angle.

   A table has for each eight rows the numbers of rule and branch, one number of all eight after another. The context:
   HK_SHEETS sheets, then HK_CHOICES branches, then HK_VALUES values of what is held. */

#define HK_ROW (HK_W + HK_B)
#define HK_BLOCKS(rows) (((rows) + 7) / 8)

/* The lesser of how real a posture is and how far within the limits; of what is not real the latter says nothing. */
static double hk_margin(const hk_t *y, int l) {
  const double real = y[HK_N][l], within = y[HK_N + 1][l];
  return real < 0.0 || real < within ? real : within;
}

static void hk_pose(const double *pose, hk_t *x) {
  for (int i = 0; i < 16; i++) x[i] = hk_all(pose[i]);
}

/* Rows first ... first + HK_LANES - 1 of a table. */
static void hk_rows(const double *table, int first, hk_t *x) {
  const double *block = table + (first / 8) * 8 * HK_ROW + first % 8;
  for (int j = 0; j < HK_ROW; j++)
    for (int l = 0; l < HK_LANES; l++) x[16 + j][l] = block[8 * j + l];
}

static void hk_take(const hk_t *y, int l, double *out) {
  for (int j = 0; j < HK_N; j++) out[j] = y[j][l];
}

static int hk_serves(const hk_t *y, int l) { return hk_margin(y, l) > HK_DOUBT; }

/* The first sheet that serves, its posture and its margin in q; HK_SHEETS where none does, -1 where the pose is none. */
static int hk_first(const double *table, hk_t *x, double *q) {
  hk_t y[HK_NY];
  for (int s = 0; s < HK_SHEETS; s += HK_LANES) {
    hk_rows(table, s, x);
    hk_body(x, y);
    if (!(y[HK_N + 2][0] < HK_OFF)) return -1;
    for (int l = 0; l < HK_LANES && s + l < HK_SHEETS; l++)
      if (hk_serves(y, l)) {
        hk_take(y, l, q);
        q[HK_N] = hk_margin(y, l);
        return s + l;
      }
  }
  return HK_SHEETS;
}

#if HK_W > 0
/* The rule of one value of what is held: its first monomial is 1. */
static void hk_held(hk_t *x, int l, double c, const double *branch) {
#if HK_SLIDE
  x[16][l] = c;
#else
  x[16][l] = sin(c);
  x[16 + HK_W / 2][l] = cos(c);
#endif
  for (int i = 0; i < HK_B; i++) x[16 + HK_W + i][l] = branch[i];
}

/* The margin of an arc at eight values between two others, the best of which is kept with its posture. */
static void hk_closer(hk_t *x, const double *branch, double *c, double *step, double low, double high, double *q) {
  hk_t y[HK_NY];
  const double centre = *c, part = *step / 4.5;
  for (int i = 0; i < 8; i += HK_LANES) {
    double values[HK_LANES];
    for (int l = 0; l < HK_LANES; l++) {
      const double value = centre + (i + l - (i + l < 4 ? 4 : 3)) * part;
      values[l] = value < low ? low : value > high ? high : value;
      hk_held(x, l, values[l], branch);
    }
    hk_body(x, y);
    for (int l = 0; l < HK_LANES; l++)
      if (hk_margin(y, l) > q[HK_N] + HK_TIE) {
        hk_take(y, l, q);
        q[HK_N] = hk_margin(y, l);
        *c = values[l];
      }
  }
  *step = part;
}
#endif

/* The posture of the arcs with the largest margin, and that, in q (HK_N + 1). Arcs that differ in one sign often have the
   same: then the first of them is taken. */
static void hk_widest(const double *context, hk_t *x, double *q) {
  hk_t y[HK_NY];
  q[HK_N] = -HUGE_VAL;
  const double *branches = context + 8 * HK_ROW * HK_BLOCKS(HK_SHEETS);
#if HK_W == 0
  for (int k = 0; k < HK_CHOICES; k += HK_LANES) {
    for (int l = 0; l < HK_LANES; l++)
      for (int i = 0; i < HK_B; i++) x[16 + i][l] = branches[HK_B * (k + l < HK_CHOICES ? k + l : 0) + i];
    hk_body(x, y);
    for (int l = 0; l < HK_LANES; l++)
      if (hk_margin(y, l) > q[HK_N] + HK_TIE) {
        hk_take(y, l, q);
        q[HK_N] = hk_margin(y, l);
      }
  }
#else
  /* Each arc at each value. */
  const double *values = branches + HK_B * HK_CHOICES, low = values[0], high = values[HK_VALUES - 1];
  double margin[HK_CHOICES * HK_VALUES];
  for (int j = 0; j < HK_ROW; j++) x[16 + j] = hk_all(0.0);
  for (int i = 0; i < HK_CHOICES * HK_VALUES; i += HK_LANES) {
    for (int l = 0; l < HK_LANES; l++) {
      const int at = i + l < HK_CHOICES * HK_VALUES ? i + l : 0;
      hk_held(x, l, values[at % HK_VALUES], branches + HK_B * (at / HK_VALUES));
    }
    hk_body(x, y);
    for (int l = 0; l < HK_LANES && i + l < HK_CHOICES * HK_VALUES; l++) margin[i + l] = hk_margin(y, l);
  }
  /* Closer to the largest if it serves, else to many, since between two values one may: at first to peaks. */
  const double step = values[1] - values[0], begin = HK_TURNS ? low - step : low, end = HK_TURNS ? high + step : high;
  for (int round = 0, most = HK_TRIES; round < 2 && !(q[HK_N] > 0.0); round++) {
    int tops[HK_CHOICES * HK_VALUES], count = 0;
    for (int i = 0; i < HK_CHOICES * HK_VALUES; i++) {
      const int j = i % HK_VALUES, track = i - j;
      const int before = j > 0 ? i - 1 : HK_TURNS ? track + HK_VALUES - 1 : i;
      const int after = j + 1 < HK_VALUES ? i + 1 : HK_TURNS ? track : i;
      const int peak = margin[i] + HK_TIE >= margin[before] && margin[i] + HK_TIE >= margin[after];
      if (round == 0 ? peak && margin[i] > HK_HOPE : !peak && margin[i] > HK_LAST_HOPE) tops[count++] = i;
    }
    for (int tries = 0; tries < most && count > 0; tries++) {
      int at = 0;
      for (int k = 1; k < count; k++)
        if (margin[tops[k]] > margin[tops[at]] + HK_TIE) at = k;
      const int top = tops[at];
      for (int k = at + 1; k < count; k++) tops[k - 1] = tops[k];
      count--;
      if (margin[top] > 0.0) most = 1;
      double c = values[top % HK_VALUES], width = step, here[HK_N + 1];
      for (int j = 0; j < HK_ROW; j++) x[16 + j] = hk_all(0.0);
      here[HK_N] = -HUGE_VAL;
      for (int l = 0; l < HK_LANES; l++) hk_held(x, l, c, branches + HK_B * (top / HK_VALUES));
      hk_body(x, y);
      hk_take(y, 0, here);
      here[HK_N] = hk_margin(y, 0);
      for (int k = 0; k < HK_STEPS; k++) hk_closer(x, branches + HK_B * (top / HK_VALUES), &c, &width, begin, end, here);
      if (here[HK_N] > q[HK_N] + HK_TIE)
        for (int j = 0; j <= HK_N; j++) q[j] = here[j];
    }
  }
#endif
}

/* The posture of a pose, its margin and its sheet, HK_SHEETS off the map, in q (HK_N + 2); 0 where the pose is none. */
static int hk_answer(const double *pose, const double *context, double *q) {
  hk_t x[HK_NX];
  hk_pose(pose, x);
  const int sheet = hk_first(context, x, q);
  if (sheet < 0) return 0;
  if (sheet == HK_SHEETS) hk_widest(context, x, q);
  q[HK_N + 1] = sheet;
  return 1;
}

/* (pose) -> posture; 0 where there is none within the limits. */
int hk_posture(const double *const *in, double *const *out, const double *context) {
  double q[HK_N + 2];
  if (!hk_answer(in[0], context, q) || !(q[HK_N] >= 0.0)) return 0;
  for (int j = 0; j < HK_N; j++) out[0][j] = q[j];
  return 1;
}

/* (pose) -> (posture, margin, sheet), whatever the margin; 0 where the pose is none. */
int hk_place(const double *const *in, double *const *out, const double *context) {
  return hk_answer(in[0], context, out[0]);
}

/* (pose) -> the posture and the margin of each sheet (HK_SHEETS, HK_N + 1); 0 where the pose is none. */
int hk_sheets(const double *const *in, double *const *out, const double *context) {
  hk_t x[HK_NX], y[HK_NY];
  hk_pose(in[0], x);
  for (int s = 0; s < HK_SHEETS; s += HK_LANES) {
    hk_rows(context, s, x);
    hk_body(x, y);
    if (!(y[HK_N + 2][0] < HK_OFF)) return 0;
    for (int l = 0; l < HK_LANES && s + l < HK_SHEETS; l++) {
      double *row = out[0] + (s + l) * (HK_N + 1);
      hk_take(y, l, row);
      row[HK_N] = hk_margin(y, l);
    }
  }
  return 1;
}

/* The turns of a posture nearest to another, within the limits; how far it then is off it, infinite for no numbers. */
static double hk_turned(double *q, const double *near) {
  double far = 0.0;
  for (int j = 0; j < HK_N; j++) {
    if (hk_hinge[j]) {
      double turns = rint((near[j] - q[j]) / HK_TURN);
      const double low = ceil((hk_low[j] - q[j]) / HK_TURN - 1e-6), high = floor((hk_high[j] - q[j]) / HK_TURN + 1e-6);
      turns = turns < low ? low : turns > high ? high : turns;
      q[j] += HK_TURN * turns;
    }
    const double gap = fabs(near[j] - q[j]);
    if (gap != gap) return HUGE_VAL;
    far = gap > far ? gap : far;
  }
  return far;
}

/* (pose, q) -> (posture, sheet, whether it is another one than that of q, or turns a joint); 0 where there is none. */
int hk_stay(const double *const *in, double *const *out, const double *context) {
  hk_t x[HK_NX], y[HK_NY], tool[16], q[HK_N];
  double pose[16], row[HK_N + 2], nearest = HK_ON, far = HUGE_VAL;
  int own = -1, served = -1;
  /* The sheet of q: the one whose posture at its tool pose is nearest to it. */
  for (int j = 0; j < HK_N; j++) q[j] = hk_all(in[1][j]);
  hk_tool(q, tool);
  for (int i = 0; i < 16; i++) pose[i] = tool[i][0];
  hk_pose(pose, x);
  for (int s = 0; s < HK_SHEETS; s += HK_LANES) {
    hk_rows(context, s, x);
    hk_body(x, y);
    for (int l = 0; l < HK_LANES && s + l < HK_SHEETS; l++) {
      if (!(hk_margin(y, l) > -HK_ON)) continue;
      hk_take(y, l, row);
      const double gap = hk_turned(row, in[1]);
      if (gap < nearest) nearest = gap, own = s + l;
    }
  }
  /* At the pose it goes on if it serves without a turn of a joint, else the nearest does. */
  hk_pose(in[0], x);
  for (int s = 0; s < HK_SHEETS; s += HK_LANES) {
    hk_rows(context, s, x);
    hk_body(x, y);
    if (!(y[HK_N + 2][0] < HK_OFF)) return 0;
    for (int l = 0; l < HK_LANES && s + l < HK_SHEETS; l++) {
      if (!hk_serves(y, l)) continue;
      hk_take(y, l, row);
      const double gap = hk_turned(row, in[1]), away = s + l == own && gap <= HK_TURN / 2 ? -1.0 : gap;
      if (away < far) {
        far = away, served = s + l;
        for (int j = 0; j < HK_N; j++) out[0][j] = row[j];
      }
    }
  }
  if (served < 0) {
    hk_widest(context, x, row);
    if (!(row[HK_N] >= 0.0)) return 0;
    hk_turned(row, in[1]);
    for (int j = 0; j < HK_N; j++) out[0][j] = row[j];
  }
  out[0][HK_N] = served;
  out[0][HK_N + 1] = served < 0 || served != own || far >= 0.0;
  return 1;
}

/* hk_place at many poses; rows of a pose that is none are NaN. */
void hk_batch(long long count, const double *poses, const double *context, double *out) {
  for (long long i = 0; i < count; i++) {
    double *row = out + i * (HK_N + 2);
    if (!hk_answer(poses + 16 * i, context, row))
      for (int j = 0; j < HK_N + 2; j++) row[j] = NAN;
  }
}
