/* ${head} */
#include "${name}_sheets.h"
#include <math.h>
${includes}

enum { SERVED = 1, PIECES = ${pieces}, SAMPLED = ${sampled} };

/* Sampled poses that have a sheet, then the stations of each sheet: position, and ${length} / sqrt(2) times the
   rotation by rows${seen_words}; and half the squared length. */
static const double places[${places_count}][12] = {
${places}
};
static const double halves[${places_count}] = {${halves}};

/* Where the sampled poses end, and the stations of each sheet; the sheets of the poses, the joints of the stations. */
static const int ends[${ends_count}] = {${ends}};
static const int labels[${sampled}] = {${labels}};
static const double joints[${stations_count}][${n}] = {
${stations}
};

/* A wanted pose as the sheets take it. */
static void given(const double target[16], double wanted[16]) {
  for (int i = 0; i < 16; i++) wanted[i] = ${number};
}

/* The nearest of the stations of a sheet, of the sampled poses for -1, further away than `beyond`, which becomes how
   far it is. Returns -1 where there is none. */
static int nearest(const double target[16], int sheet, double *beyond) {
  const double turn = ${turn};
  double at[12], least = INFINITY;
  int found = -1;
  for (int i = 0; i < 3; i++) {
    at[i] = target[4 * i + 3];
    for (int j = 0; j < 3; j++) at[3 + 3 * i + j] = turn * target[4 * i + j];
  }
${seen_code}  for (int p = sheet < 0 ? 0 : ends[sheet]; p < ends[sheet + 1]; p++) {
    double value = halves[p];
    for (int i = 0; i < 12; i++) value -= at[i] * places[p][i];
    if (value > *beyond && value < least) least = value, found = p;
  }
  *beyond = least;
  return found;
}

/* The posture of a sheet, straight from q. Returns whether there is one. */
static int go(int sheet, const double target[16], double q[${n}]) {
  double wanted[16], leaf[${rows}];
  int status = -2;
  given(target, wanted);
  switch (sheet) {
${cases}
  }
  return status == 0 || status == SERVED;
}

int ${name}_sheets_of(int sheet, const double target[16], double q[${n}]) {
  double at[${n}], beyond = -INFINITY;
  if (sheet < 0 || sheet >= ${count}) return 0;
  for (int k = 0; k < ${most_stations}; k++) {
    const int p = nearest(target, sheet, &beyond);
    if (p < 0) return 0;
    for (int i = 0; i < ${n}; i++) at[i] = joints[p - SAMPLED][i];
    if (!go(sheet, target, at)) continue;
    for (int i = 0; i < ${n}; i++) q[i] = at[i];
    return 1;
  }
  return 0;
}

static int any_but(int none, const double target[16], double q[${n}]) {
  double beyond = -INFINITY;
  const int p = nearest(target, -1, &beyond), first = p < 0 ? -1 : labels[p];
  if (first >= 0 && first != none && ${name}_sheets_of(first, target, q)) return first;
  for (int sheet = 0; sheet < ${count}; sheet++)
    if (sheet != first && sheet != none && ${name}_sheets_of(sheet, target, q)) return sheet;
  return -1;
}

int ${name}_sheets(const double target[16], double q[${n}]) { return any_but(-1, target, q); }

int ${name}_sheets_near(const double target[16], double q[${n}], int sheet) {
  double at[${n}], own[${n}];
  int same = ${name}_sheets_of(sheet, target, own);
  for (int i = 0; i < ${n}; i++) at[i] = q[i];
  same = same && go(sheet, target, at);
  for (int i = 0; same && i < ${n}; i++) same = fabs(at[i] - own[i]) < 1e-6;
  if (!same) return any_but(sheet, target, q);
  for (int i = 0; i < ${n}; i++) q[i] = own[i];
  return sheet;
}
