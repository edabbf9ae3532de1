#include "emulator/geometry/frame.h"

#include <math.h>

const struct frame frame_identity = {{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}}};

/* Rotate the direction `in` by the rotation of `frame`, without its translation; result in `out`. */
void frame_direction(const struct frame *frame, const double in[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = frame->row[i][0] * in[0] + frame->row[i][1] * in[1] + frame->row[i][2] * in[2];
    }
}

/* Transform the point `in` (metres) by rotation and translation of `frame`; result in `out`. */
void frame_point(const struct frame *frame, const double in[3], double out[3])
{
    frame_direction(frame, in, out);
    for (int i = 0; i < 3; i++) {
        out[i] += frame->row[i][3];
    }
}

/* Compose two rigid transforms: the result applies b first, then a. */
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

/* Return the inverse of a rigid transform: rotation R^T, translation -R^T t. */
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

/* Return the rigid transform that rotates by |rotation_vector| radians about the direction of the vector (Rodrigues'
 * formula) and then translates (metres). */
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

/* Compute the rotation vector of a frame, of length 0 to pi: the inverse of frame_of_offset(). The largest component of
 * the quaternion is computed first, which avoids cancellation (Shepperd 1978). */
void frame_rotation_vector(const struct frame *frame, double rotation_vector[3])
{
    const double (*m)[4] = frame->row;
    const double trace = m[0][0] + m[1][1] + m[2][2];
    double q[4] = {1.0 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]}; /* w x y z, any length */
    int largest = 0;
    double diagonal = trace;
    for (int k = 0; k < 3; k++) {
        if (m[k][k] > diagonal) {
            diagonal = m[k][k];
            largest = k + 1;
        }
    }
    if (largest > 0) {
        const int i = largest - 1, j = largest % 3, k = (largest + 1) % 3;
        q[0] = m[k][j] - m[j][k];
        q[1 + i] = 1.0 + 2.0 * m[i][i] - trace;
        q[1 + j] = m[i][j] + m[j][i];
        q[1 + k] = m[i][k] + m[k][i];
    }
    const double sign = q[0] < 0.0 ? -1.0 : 1.0;
    const double sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double scale = sine > 0.0 ? 2.0 * atan2(sine, sign * q[0]) / sine * sign : 0.0;
    for (int k = 0; k < 3; k++) {
        rotation_vector[k] = scale * q[1 + k];
    }
}
