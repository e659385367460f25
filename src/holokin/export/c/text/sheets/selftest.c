/* ${head} */
#include "${name}_sheets.h"
#include <math.h>
#include <stdio.h>

static const double poses[${tested}][16] = {
${tested_poses}
};
static const double joints[${tested}][${n}] = {
${tested_joints}
};
static const int sheets[${tested}] = {${tested_sheets}};

int main(void) {
  int wrong = 0;
  for (int p = 0; p < ${tested}; p++) {
    double q[${n}], off = 0;
    const int sheet = ${name}_sheets(poses[p], q);
    for (int i = 0; i < ${n}; i++) off = fmax(off, fabs(q[i] - joints[p][i]));
    if (sheet != sheets[p] || !(off < ${close})) wrong++, printf("pose %d: sheet %d, off by %g\n", p, sheet, off);
  }
  printf("%d of ${tested} poses have the joints of the map\n", ${tested} - wrong);
  return wrong != 0;
}
