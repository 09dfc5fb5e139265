// Assets that lie far from zero, beside each other (asset.h).
#include <string.h>

#include "renderer/scene/asset.h"
#include "renderer/scene/xform.h"

static bool is_far(const struct hg_asset *asset)
{
    const double *o = asset->file.origin;
    return o[0] != 0 || o[1] != 0 || o[2] != 0;
}

// Along the axes of a root, which may be turned so that the file stands upright.
static void move_root(struct hg_node *root, const float delta[3])
{
    float m[16];
    if (root->has_matrix)
        memcpy(m, root->matrix, sizeof m);
    else
        hg_mat4_from_trs(root->translation, root->rotation, root->scale, m);
    float *to = root->has_matrix ? root->matrix + 12 : root->translation;
    for (int r = 0; r < 3; r++)
        to[r] += m[r] * delta[0] + m[4 + r] * delta[1] + m[8 + r] * delta[2];
}

void hg_asset_align_origin(const struct hg_scene *scene, struct hg_asset *asset)
{
    const struct hg_asset *first = NULL;
    for (uint32_t i = 0; !first && i < scene->asset_count; i++)
        if (is_far(scene->assets[i]))
            first = scene->assets[i];
    if (!first || !is_far(asset))
        return;
    float delta[3];
    for (int c = 0; c < 3; c++)
        delta[c] = (float)(asset->file.origin[c] - first->file.origin[c]);
    for (uint32_t i = 0; i < asset->root_count; i++)
        move_root(asset->roots[i], delta);
}
