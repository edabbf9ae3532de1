#include "emulator/geometry/contact_load.h"

#include <math.h>

#include "emulator/physics/layer.h"

/* Springs of the whole cells of a square (cells wholly below one face of the object), in the object's frame. */
struct square_springs {
    double arm[3][SHAPE_LINES];       /* point where the object presses, relative to the bracket's origin; metres */
    double force[3][SHAPE_LINES];     /* newtons */
    double spring[3][3][SHAPE_LINES]; /* stiffness, N/m; lower triangle */
};

/* Compute for each of the 16 cells of a square the point (metres) at which the object loads the cell, relative to the
 * bracket's origin, in the object's frame: the centre of pressure, at the depth of the face there. */
static void compute_arms(struct square_springs *springs, const struct load_square *square,
                         const struct cover_whole *whole)
{
    const struct cover_square *places = square->places;
    for (int k = 0; k < 3; k++) {
        const double origin = square->object_from_bracket->row[k][3];
        for (int i = 0; i < SHAPE_LINES; i++) {
            const double a = whole->centre[0][i], b = whole->centre[1][i];
            const double depth = whole->depth[i] + whole->change[0][i] * a + whole->change[1][i] * b;
            springs->arm[k][i] = places->top[k][i] + a * places->half[0][k][i] + b * places->half[1][k][i] -
                                 depth * places->normal[k][i] - origin;
        }
    }
}

/* Compute the shear of each cell: the displacement (metres, along the surface of the object) of the cell's top from the
 * point where the cell sticks to the object; 0 for a cell that did not stick before. If only a share of the cell stuck
 * before, the displacement is multiplied by this share, as in add_shear_spring(). */
static void compute_shears(double shear[3][SHAPE_LINES], const struct load_square *square,
                           const struct cover_whole *whole, const struct contact_grip *grip)
{
    const double *stuck = &grip->stuck[square->first];
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < SHAPE_LINES; i++) {
            const double share = stuck[i] < 1.0 ? stuck[i] : 1.0; /* of the cell that stuck before */
            const double slip = square->places->top[k][i] - grip->point[square->first + (size_t)i][k];
            shear[k][i] = stuck[i] > 0.0 ? share * slip : 0.0;
        }
    }
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double *const n[3] = {whole->normal[0], whole->normal[1], whole->normal[2]};
        const double along = shear[0][i] * n[0][i] + shear[1][i] * n[1][i] + shear[2][i] * n[2][i];
        for (int k = 0; k < 3; k++) {
            shear[k][i] -= along * n[k][i];
        }
    }
}

/* Compute forces (N) and stiffnesses (N/m) of the 16 cells of a square: pressure along the normal n of the face above
 * the cell, and shear s, which friction limits. The face above a cell has the area of the cell divided by `steep`, the
 * cosine between both normals (at least COVER_STEEPEST). The stiffness matrix of a cell is rate n n^T + shear_rate (I -
 * n n^T) - along s s^T, of which the lower triangle is stored. The last term removes the stiffness along the shear of a
 * sliding cell. Cells that are not wholly below one face get 0. If `grip->advances` is set, stores where each whole cell
 * sticks after this step. */
static void compute_springs(struct square_springs *springs, const struct load_square *square,
                            const struct cover_whole *whole, const struct contact_grip *grip)
{
    double shear[3][SHAPE_LINES], kept[SHAPE_LINES];
    compute_shears(shear, square, whole, grip);
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double area = whole->is_whole[i] ? square->cells[i].area : 0.0, steep = whole->steep[i];
        const double pressing = whole->pressure[i] * area / steep, rate = whole->rate[i] * area / (steep * steep);
        const double spring = layer_shear_stiffness() * area;
        /* square of the length of the shear, m2 */
        const double length = shear[0][i] * shear[0][i] + shear[1][i] * shear[1][i] + shear[2][i] * shear[2][i];
        const double limit = grip->coefficient * pressing, reached = spring * sqrt(length);
        const bool is_sliding = contact_load_slides(reached, limit);
        const double share = is_sliding ? limit / reached : 1.0, shear_rate = spring * share;
        const double along = is_sliding ? shear_rate / length : 0.0, across = rate - shear_rate;
        kept[i] = share;
        for (int j = 0; j < 3; j++) {
            const double n = whole->normal[j][i], s = shear[j][i];
            springs->force[j][i] = pressing * n - shear_rate * s;
            for (int k = 0; k <= j; k++) {
                springs->spring[j][k][i] =
                    (j == k ? shear_rate : 0.0) + across * n * whole->normal[k][i] - along * s * shear[k][i];
            }
        }
    }
    for (size_t i = 0; grip->advances && i < SHAPE_LINES; i++) {
        if (whole->is_whole[i]) {
            grip->stuck[square->first + i] = 1.0;
            for (int k = 0; k < 3; k++) {
                grip->point[square->first + i][k] = square->places->top[k][i] - kept[i] * shear[k][i];
            }
        }
    }
}

/* Add forces and stiffnesses of the 16 cells of a square to the sums of wrench and stiffness about the bracket's
 * origin. As in add_spring() of contact_load.c, a spring S at the point r has the stiffness (I, [r]) S (I, [r])^T,
 * where [r] is the cross-product matrix of r. */
static void sum_springs(struct load_sums *sums, const struct square_springs *springs)
{
    for (int i = 0; i < SHAPE_LINES; i++) {
        const double r[3] = {springs->arm[0][i], springs->arm[1][i], springs->arm[2][i]};
        const double f[3] = {springs->force[0][i], springs->force[1][i], springs->force[2][i]};
        double s[3][3], product[3][3]; /* spring, [r] S */
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k <= j; k++) {
                s[j][k] = s[k][j] = springs->spring[j][k][i];
                sums->linear[j][k][i] += s[j][k];
            }
            sums->wrench[j][i] += f[j];
        }
        sums->wrench[3][i] += r[1] * f[2] - r[2] * f[1];
        sums->wrench[4][i] += r[2] * f[0] - r[0] * f[2];
        sums->wrench[5][i] += r[0] * f[1] - r[1] * f[0];
        for (int k = 0; k < 3; k++) {
            product[0][k] = r[1] * s[2][k] - r[2] * s[1][k];
            product[1][k] = r[2] * s[0][k] - r[0] * s[2][k];
            product[2][k] = r[0] * s[1][k] - r[1] * s[0][k];
            for (int j = 0; j < 3; j++) {
                sums->mixed[j][k][i] += product[j][k];
            }
        }
        sums->turning[0][0][i] += product[0][2] * r[1] - product[0][1] * r[2];
        sums->turning[1][0][i] += product[1][2] * r[1] - product[1][1] * r[2];
        sums->turning[1][1][i] += product[1][0] * r[2] - product[1][2] * r[0];
        sums->turning[2][0][i] += product[2][2] * r[1] - product[2][1] * r[2];
        sums->turning[2][1][i] += product[2][0] * r[2] - product[2][2] * r[0];
        sums->turning[2][2][i] += product[2][1] * r[0] - product[2][0] * r[1];
    }
}

/* Add the loads of the whole cells of a square to the sums. If the grip advances, the points where the cells stick to
 * the object are updated. */
void contact_load_add_whole(struct load_sums *sums, const struct load_square *square, const struct cover_whole *whole,
                            const struct contact_grip *grip)
{
    struct square_springs springs;
    compute_arms(&springs, square, whole);
    compute_springs(&springs, square, whole, grip);
    sum_springs(sums, &springs);
}

/* Return the sum of the values of the 16 places in a square. */
static double sum_places(const double values[SHAPE_LINES])
{
    double sum = 0.0;
    for (int i = 0; i < SHAPE_LINES; i++) {
        sum += values[i];
    }
    return sum;
}

/* Add the sums of the whole cells to the load of a board. Only the lower triangle of the stiffness is set. */
void contact_load_join(struct contact_load *load, const struct load_sums *sums)
{
    for (int i = 0; i < 6; i++) {
        load->wrench[i] += sum_places(sums->wrench[i]);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            load->stiffness[3 + i][j] += sum_places(sums->mixed[i][j]);
            load->stiffness[i][j] += j <= i ? sum_places(sums->linear[i][j]) : 0.0;
            load->stiffness[3 + i][3 + j] += j <= i ? sum_places(sums->turning[i][j]) : 0.0;
        }
    }
}
