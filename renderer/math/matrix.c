// matrix.c - see matrix.h.
#include "renderer/math/matrix.h"

#include <math.h>
#include <string.h>

void hg_matrix_multiply(const double a[16], const double b[16], double c[16])
{
    double out[16];
    for (int col = 0; col < 4; col++)
        for (int row = 0; row < 4; row++) {
            double sum = 0.0;
            for (int k = 0; k < 4; k++)
                sum += a[k * 4 + row] * b[col * 4 + k];
            out[col * 4 + row] = sum;
        }
    memcpy(c, out, sizeof out);
}

void hg_matrix_from_float(const float m[16], double out[16])
{
    for (int i = 0; i < 16; i++)
        out[i] = m[i];
}

double hg_matrix_determinant3(const double m[16])
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9]) +
           m[8] * (m[1] * m[6] - m[2] * m[5]);
}

void hg_matrix_store4x3(const double m[16], struct hg_mat4x3 *out)
{
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 3; r++)
            out->m[c * 3 + r] = (float)m[c * 4 + r];
}

// Largest singular value of the linear part: root of the largest eigenvalue of its square, by the
// bound of Gershgorin's circles after two squarings.
float hg_matrix_max_stretch(const struct hg_mat4x3 *world)
{
    double a[9], b[9];
    const float *m = world->m;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            a[i * 3 + j] = (double)m[i * 3] * m[j * 3] + (double)m[i * 3 + 1] * m[j * 3 + 1] +
                           (double)m[i * 3 + 2] * m[j * 3 + 2];
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < 9; i++) {
            b[i] = 0.0;
            for (int k = 0; k < 3; k++)
                b[i] += a[i / 3 * 3 + k] * a[k * 3 + i % 3];
        }
        memcpy(a, b, sizeof a);
    }
    double most = 0.0;
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(a[i * 3]) + fabs(a[i * 3 + 1]) + fabs(a[i * 3 + 2]));
    return (float)(sqrt(sqrt(sqrt(most))) * (1.0 + 1e-6));
}
