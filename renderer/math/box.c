// box.c - see box.h.
#include <float.h>
#include <math.h>

#include "renderer/math/box.h"

struct hg_box hg_box_empty(void)
{
    return (struct hg_box){{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
}

bool hg_box_is_empty(const struct hg_box *box)
{
    return box->min[0] > box->max[0];
}

void hg_box_add_point(struct hg_box *box, const float p[3])
{
    for (int i = 0; i < 3; i++) {
        box->min[i] = p[i] < box->min[i] ? p[i] : box->min[i];
        box->max[i] = p[i] > box->max[i] ? p[i] : box->max[i];
    }
}

void hg_box_add(struct hg_box *box, const struct hg_box *other)
{
    if (hg_box_is_empty(other))
        return;
    hg_box_add_point(box, other->min);
    hg_box_add_point(box, other->max);
}

struct hg_box hg_box_transform(const struct hg_box *box, const double m[16])
{
    struct hg_box out = hg_box_empty();
    if (hg_box_is_empty(box))
        return out;
    for (int r = 0; r < 3; r++) {
        double center = m[12 + r], extent = 0.0;
        for (int c = 0; c < 3; c++) {
            const double mid = 0.5 * ((double)box->min[c] + box->max[c]);
            const double half = 0.5 * ((double)box->max[c] - box->min[c]);
            center += m[c * 4 + r] * mid;
            extent += fabs(m[c * 4 + r]) * half;
        }
        // Room for the rounding of the float positions in shaders.
        extent += 1e-6 * (fabs(center) + extent) + 1e-9;
        out.min[r] = (float)(center - extent);
        out.max[r] = (float)(center + extent);
    }
    return out;
}
