/* Intersection of lines with a convex polytope, in double precision.
 *
 *     double separation[6];
 *     taxel_polytope_separation(&polytope, points, directions, 2, 3, separation);  // 2 lines with 3 points each
 */
#ifndef TAXEL_POLYTOPE_RAYS_H
#define TAXEL_POLYTOPE_RAYS_H

#include <stddef.h>

/* Half-spaces normal . p <= offset; normals are unit vectors, offsets metres. */
struct taxel_polytope {
    size_t faces;
    const double *normals; /* [faces][3] */
    const double *offsets; /* [faces] */
};

/* Return the size of struct taxel_polytope, which callers in other languages compare with their own. */
size_t taxel_polytope_struct_size(void);

/* Compute the distance of each point to the polytope along its line, metres: negative inside, infinite for a line that
 * misses the polytope or leaves it behind the point.
 * points: [lines][points_per_line][3], metres. directions: [lines][3], unit vectors. separation:
 * [lines][points_per_line]. */
void taxel_polytope_separation(const struct taxel_polytope *polytope, const double *points, const double *directions,
                               size_t lines, size_t points_per_line, double *separation);

#endif
