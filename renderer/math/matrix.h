// matrix.h - affine matrices in double precision, and as the device reads them.
// Floor 1 (math). Pure: any thread. Column-major.
#ifndef HG_RENDERER_MATH_MATRIX_H
#define HG_RENDERER_MATH_MATRIX_H

#include "shaders/shared/types.h"

// c = a * b, column-major; c may be a.
void hg_matrix_multiply(const double a[16], const double b[16], double c[16]);
void hg_matrix_from_float(const float m[16], double out[16]);
double hg_matrix_determinant3(const double m[16]);
void hg_matrix_store4x3(const double m[16], struct hg_mat4x3 *out);
// The most that a length grows under the matrix (largest singular value of the linear part),
// rounded up. Source: Gershgorin's circles after two squarings.
float hg_matrix_max_stretch(const struct hg_mat4x3 *matrix);

#endif
