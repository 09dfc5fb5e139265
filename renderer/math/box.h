// box.h - axis-aligned bounding boxes.
// Floor 1 (math). Pure: any thread. Lengths in metres.
#ifndef HG_RENDERER_MATH_BOX_H
#define HG_RENDERER_MATH_BOX_H

#include <stdbool.h>

struct hg_box {
    float min[3], max[3]; // empty: min > max
};
// A box without points; then boxes are grown to contain a point, or another box.
struct hg_box hg_box_empty(void);
bool hg_box_is_empty(const struct hg_box *box);
void hg_box_add_point(struct hg_box *box, const float p[3]);
void hg_box_add(struct hg_box *box, const struct hg_box *other);
// Box of the box under a column-major affine matrix (double), a little larger than exact.
struct hg_box hg_box_transform(const struct hg_box *box, const double matrix[16]);

#endif
