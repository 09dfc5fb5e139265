// Names of objects in UTF-8.
#include <string.h>

#include "base/alloc.h"
#include "base/utf8.h"
#include "renderer/scene/asset.h"

// Files of these formats hold names as bytes. What is not UTF-8 is taken for Latin-1, so that names
// which differ stay different.
static bool make_utf8(char **name)
{
    const size_t size = strlen(*name);
    if (hg_utf8_is_valid(*name, size))
        return true;
    char *to = hg_calloc(2 * size + 1, 1);
    if (!to)
        return false;
    size_t n = 0;
    for (const char *from = *name; *from; from++) {
        const unsigned char c = (unsigned char)*from;
        if (c >= 0x80)
            to[n++] = (char)(0xc0 | c >> 6);
        to[n++] = (char)(c >= 0x80 ? 0x80 | (c & 0x3f) : c);
    }
    hg_free(*name);
    *name = to;
    return true;
}

bool hg_asset_make_names_utf8(struct hg_asset *a)
{
    bool made = true;
    for (uint32_t i = 0; i < a->node_count; i++)
        made = made && make_utf8(&a->nodes[i]->head.name);
    for (uint32_t i = 0; i < a->mesh_count; i++)
        made = made && make_utf8(&a->meshes[i]->head.name);
    for (uint32_t i = 0; i < a->material_count; i++)
        made = made && make_utf8(&a->materials[i]->head.name);
    for (uint32_t i = 0; i < a->texture_count; i++)
        made = made && make_utf8(&a->textures[i]->head.name);
    for (uint32_t i = 0; i < a->light_count; i++)
        made = made && make_utf8(&a->lights[i]->head.name);
    for (uint32_t i = 0; i < a->camera_count; i++)
        made = made && make_utf8(&a->cameras[i]->head.name);
    for (uint32_t i = 0; i < a->animation_count; i++)
        made = made && make_utf8(&a->animations[i].name);
    return made;
}
