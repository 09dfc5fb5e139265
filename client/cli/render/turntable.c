// turntable.c - helio render: the camera's way once around its target.
#include <math.h>
#include <string.h>

#include "client/cli/render/frames.h"

static const double pi = 3.14159265358979323846;

// Rotates a vector about +Y by an angle whose cosine and sine are given, as theta of --orbit grows.
static void rotate(const float from[3], double c, double s, float out[3])
{
    const double x = (double)from[0], z = (double)from[2];
    out[0] = (float)(x * c + z * s);
    out[1] = from[1];
    out[2] = (float)(z * c - x * s);
}

static void turn_at(const struct hgp_view_camera *start, double turns, float eye[3], float up[3])
{
    const double angle = 2 * pi * (turns - floor(turns));
    const float upright[3] = {0, 1, 0};
    float offset[3];
    for (int i = 0; i < 3; i++)
        offset[i] = start->eye[i] - start->target[i];
    rotate(offset, cos(angle), sin(angle), eye);
    rotate(start->has_up ? start->up : upright, cos(angle), sin(angle), up);
    for (int i = 0; i < 3; i++)
        eye[i] += start->target[i];
    if (turns == floor(turns)) // the sum rounds
        memcpy(eye, start->eye, sizeof start->eye);
}

void hg_cli_turntable_camera(
    const struct hg_cli_turntable *t, int32_t frame, struct hgp_view_camera *out)
{
    *out = t->start;
    out->has_up = true;
    turn_at(&t->start, (double)frame / t->frames, out->eye, out->up);
    if (!t->moves)
        return;
    out->has_next_eye = out->has_next_target = out->has_next_up = true;
    memcpy(out->next_target, t->start.target, sizeof out->next_target);
    turn_at(&t->start, ((double)frame + 1) / t->frames, out->next_eye, out->next_up);
}
