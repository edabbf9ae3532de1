/* Clipping of lines by half-spaces (Cyrus and Beck 1978): a line enters the polytope at the last face that it crosses
 * inwards, and leaves it at the first face that it crosses outwards. */
#include "polytope_rays.h"

#include <math.h>

#define BLOCK 16u /* points that are clipped together: their data fit into registers and the first-level cache */

/* Speed towards a face, below which a line is parallel to the face: the quotient of a distance and a smaller speed could
 * overflow. */
#define PARALLEL 1e-250

/* Points with the directions of their lines, by coordinate, and the range of distances in which each line is inside all
 * half-spaces so far. */
struct block {
    double point[3][BLOCK], direction[3][BLOCK];
    double enter[BLOCK], leave[BLOCK];
};

size_t taxel_polytope_struct_size(void)
{
    return sizeof(struct taxel_polytope);
}

/* Return the scalar product of a vector and vector i of a block, which is stored by component. */
static double project(const double vector[3], const double block[3][BLOCK], size_t i)
{
    return vector[0] * block[0][i] + vector[1] * block[1][i] + vector[2] * block[2][i];
}

/* Fill a block with `count` points from number `first` on; the rest repeats the first of these points, so that all
 * points of the block can be clipped. */
static void load(struct block *block, const double *points, const double *directions, size_t points_per_line,
                 size_t first, size_t count)
{
    for (size_t i = 0; i < BLOCK; i++) {
        const size_t index = first + (i < count ? i : 0u);
        for (size_t k = 0; k < 3u; k++) {
            block->point[k][i] = points[3u * index + k];
            block->direction[k][i] = directions[3u * (index / points_per_line) + k];
        }
        block->enter[i] = -INFINITY;
        block->leave[i] = INFINITY;
    }
}

/* Clip the lines of a block by a half-space. A line that is parallel to its face remains whole or misses it. */
static void clip(struct block *block, const double normal[3], double offset)
{
    for (size_t i = 0; i < BLOCK; i++) {
        const double speed = project(normal, block->direction, i);
        const double depth = offset - project(normal, block->point, i);
        const int is_inward = speed <= -PARALLEL, is_outward = speed >= PARALLEL;
        const double crossing = depth / (is_inward || is_outward ? speed : 1.0);
        const double enter = is_inward ? crossing : -INFINITY;
        const double leave = is_outward ? crossing : is_inward || depth >= 0.0 ? INFINITY : -INFINITY;
        block->enter[i] = enter > block->enter[i] ? enter : block->enter[i];
        block->leave[i] = leave < block->leave[i] ? leave : block->leave[i];
    }
}

void taxel_polytope_separation(const struct taxel_polytope *polytope, const double *points, const double *directions,
                               size_t lines, size_t points_per_line, double *separation)
{
    const size_t total = lines * points_per_line;
    struct block block;
    for (size_t first = 0; first < total; first += BLOCK) {
        const size_t count = total - first < BLOCK ? total - first : BLOCK;
        load(&block, points, directions, points_per_line, first, count);
        for (size_t face = 0; face < polytope->faces; face++) {
            clip(&block, polytope->normals + 3u * face, polytope->offsets[face]);
        }
        for (size_t i = 0; i < count; i++) {
            const int is_hit = block.enter[i] <= block.leave[i] && block.leave[i] >= 0.0;
            separation[first + i] = is_hit ? block.enter[i] : INFINITY;
        }
    }
}
