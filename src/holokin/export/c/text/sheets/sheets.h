/* ${head}

   Poses are 4x4 matrices by rows (16 numbers): the tool in the base frame. Lengths in m, angles in rad. */
#ifndef ${NAME}_SHEETS_H
#define ${NAME}_SHEETS_H

#ifdef __cplusplus
extern "C" {
#endif

enum { ${NAME}_SHEETS = ${count}, ${NAME}_SHEETS_N = ${n} };

/* The joints q at a tool pose, a function of the pose alone. Returns the sheet, or -1 where no sheet serves the pose:
   then q stays. */
int ${name}_sheets(const double target[16], double q[${n}]);

/* The same for a loop: q is the last answer, on `sheet`, which is kept while it serves the pose and leads to it. Then
   another sheet is taken, with joints elsewhere; -1 where none serves, or only this one with joints elsewhere. */
int ${name}_sheets_near(const double target[16], double q[${n}], int sheet);

/* The joints of one sheet at a tool pose; 0 where it does not serve it: then q stays. */
int ${name}_sheets_of(int sheet, const double target[16], double q[${n}]);

#ifdef __cplusplus
}
#endif

#endif
