// Emitters of ray geometry. See emitters.h.
#include "base/alloc.h"
#include "renderer/light/emitters/emitters.h"

static bool emits(const struct hg_material *m)
{
    return m && (m->emissive[0] > 0 || m->emissive[1] > 0 || m->emissive[2] > 0);
}

// Vertices of parts without levels of detail are numbered as in their mesh.
static void find_coordinates(const struct hg_draw_info *info, struct hg_emitter_part *part)
{
    const struct hg_ray_geometry_piece *piece = part->piece;
    const struct hg_mesh_part *mesh = &info->mesh->parts[info->part];
    const uint32_t set = info->material->slots[HG_SLOT_EMISSIVE].uv_set;
    if (piece->vertices && set == 0) {
        part->uv = &piece->vertices->uv.x;
        part->uv_stride = sizeof *piece->vertices / sizeof(float);
    } else if (!(piece->flags & HG_DRAW_LOD) && set <= 1 &&
               mesh->vertex_count == piece->vertex_count) {
        part->uv = mesh->uv[set];
        part->uv_stride = 2;
    }
}

enum hg_status hg_emitters_sync(struct hg_emitters *e, const struct hg_geometry *geometry,
    const struct hg_ray_geometry *rays, const struct hg_scene *scene, struct hg_textures *textures,
    struct hg_error *err)
{
    const uint32_t count = hg_ray_geometry_count(rays);
    const struct hg_ray_geometry_piece *pieces = hg_ray_geometry_pieces(rays);
    struct hg_gpu_geometry tables;
    struct hg_emitter_part *parts = hg_calloc((size_t)count + 1, sizeof *parts);
    struct hg_emitter_input in = {.scene = scene, .parts = parts, .textures = textures};
    if (!parts)
        return hg_error_set(err, HG_E_NOMEM, "emitters", NULL, "no memory for a list of parts");
    hg_geometry_fill(geometry, &tables);
    hg_geometry_origin(geometry, in.origin);
    for (uint32_t i = 0; i < count; i++) {
        struct hg_draw_info info;
        if (!hg_geometry_draw_info(geometry, pieces[i].draw, &info) || !emits(info.material))
            continue;
        struct hg_emitter_part *part = &parts[in.part_count];
        *part = (struct hg_emitter_part){.piece = &pieces[i], .material = info.material};
        find_coordinates(&info, part);
        in.part_count++;
    }
    in.draw_count = tables.draw_count;
    in.poses = hg_ray_geometry_revision(rays);
    enum hg_status status = hg_emitters_update(e, &in, err);
    hg_free(parts);
    return status;
}
