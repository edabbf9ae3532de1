#include "emulator/geometry/frame.h"

#include <math.h>

const struct frame frame_identity = {{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}}};

/* Rotates the direction `in` by the rotation of `frame`, without its translation; result in `out`. */
void frame_direction(const struct frame *frame, const double in[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = frame->row[i][0] * in[0] + frame->row[i][1] * in[1] + frame->row[i][2] * in[2];
    }
}

/* Transforms the point `in` (metres) by rotation and translation of `frame`; result in `out`. */
void frame_point(const struct frame *frame, const double in[3], double out[3])
{
    frame_direction(frame, in, out);
    for (int i = 0; i < 3; i++) {
        out[i] += frame->row[i][3];
    }
}

/* Composition of two rigid transforms: b is applied first, then a. */
struct frame frame_product(const struct frame *a, const struct frame *b)
{
    struct frame product;
    for (int column = 0; column < 4; column++) {
        const double in[3] = {b->row[0][column], b->row[1][column], b->row[2][column]};
        double out[3];
        if (column < 3) {
            frame_direction(a, in, out);
        } else {
            frame_point(a, in, out);
        }
        for (int i = 0; i < 3; i++) {
            product.row[i][column] = out[i];
        }
    }
    return product;
}

/* Inverse of a rigid transform: rotation R^T, translation -R^T t. */
struct frame frame_inverse(const struct frame *a)
{
    struct frame inverse;
    for (int i = 0; i < 3; i++) {
        inverse.row[i][3] = 0.0;
        for (int j = 0; j < 3; j++) {
            inverse.row[i][j] = a->row[j][i];
            inverse.row[i][3] -= a->row[j][i] * a->row[j][3];
        }
    }
    return inverse;
}

/* Rigid transform of a rotation by |rotation_vector| radians about the direction of the vector (Rodrigues' formula),
 * followed by a translation (metres). */
struct frame frame_of_offset(const double translation[3], const double rotation_vector[3])
{
    const double *w = rotation_vector;
    const double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    const double s = angle > 0.0 ? sin(angle) / angle : 1.0;
    const double c = angle > 0.0 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
    const double cross[3][3] = {{0.0, -w[2], w[1]}, {w[2], 0.0, -w[0]}, {-w[1], w[0], 0.0}};
    struct frame frame = frame_identity;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double square = 0.0;
            for (int k = 0; k < 3; k++) {
                square += cross[i][k] * cross[k][j];
            }
            frame.row[i][j] += s * cross[i][j] + c * square;
        }
        frame.row[i][3] = translation[i];
    }
    return frame;
}
