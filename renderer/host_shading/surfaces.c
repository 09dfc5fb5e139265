#include "renderer/host_shading/surfaces.h"

#include "base/alloc.h"
#include "renderer/geometry/materials.h"
#include "renderer/host_shading/tails.h"
#include "renderer/math/vec.h"

// Share of light from everywhere that dielectrics of index 1.5 mirror, smooth and rough ones.
#define DIELECTRIC_SMOOTH 0.09f
#define DIELECTRIC_ROUGH  0.02f

#define CLEAR_ROUGHNESS 0.3f  // from which on glass is not clear,
#define CLEAR_SHARE     0.05f // nor where it lets through less than this

// --- materials -----------------------------------------------------------------------------------

static struct hg_host_glass make_glass(struct hg_textures *textures, const struct hg_material *m,
    float metallic, float roughness, const float base[4])
{
    struct hg_host_glass out = {.clear = false};
    struct hg_gpu_lobes lobes;
    float share[4] = {1, 1, 1, 1};
    if (m->unlit || !(m->transmission > 0))
        return out;
    hg_material_pack_lobes(m, textures, &lobes);
    if (hg_material_uses_slot(m, HG_SLOT_TRANSMISSION))
        hg_host_texture_mean(textures, m, HG_SLOT_TRANSMISSION, share);
    out.clear =
        roughness < CLEAR_ROUGHNESS && m->transmission * share[0] * (1 - metallic) > CLEAR_SHARE;
    out.thin = !(lobes.thickness > 0);
    out.ior = lobes.ior;
    for (int c = 0; c < 3; c++)
        out.tint[c] = hg_clampf(m->base_color[c] * base[c], 0, 1);
    memcpy(out.absorption, &lobes.attenuation, sizeof out.absorption);
    return out;
}

static struct hg_host_material make_material(
    struct hg_textures *textures, const struct hg_material *m)
{
    struct hg_host_material out = {.albedo = {1, 1, 1}};
    float base[4], other[4], glow[4];
    if (!m)
        return out;
    hg_host_texture_mean(textures, m, HG_SLOT_BASE_COLOR, base);
    hg_host_texture_mean(textures, m, HG_SLOT_METALLIC_ROUGHNESS, other);
    hg_host_texture_mean(textures, m, HG_SLOT_EMISSIVE, glow);
    const float metallic = m->metallic * other[2], roughness = m->roughness * other[1];
    const float even = DIELECTRIC_SMOOTH + (DIELECTRIC_ROUGH - DIELECTRIC_SMOOTH) * roughness;
    out.id = m->head.id;
    out.revision = m->head.revision;
    out.double_sided = m->double_sided;
    out.mask = hg_host_mask_create(textures, m);
    out.glass = make_glass(textures, m, metallic, roughness, base);
    for (int c = 0; c < 3; c++) {
        const float color = hg_clampf(m->base_color[c] * base[c], 0, 1);
        const float mirrored = even * hg_clampf(m->specular.factor * m->specular.color[c], 0, 1);
        out.albedo[c] =
            m->unlit ? 0 : (color * (1 - mirrored) + mirrored) * (1 - metallic) + color * metallic;
        const float emissive = m->emissive[c] * glow[c];
        out.emitted[c] = m->unlit ? 0 : hg_clampf(emissive, 0, 1e9f);
        out.emission[c] = m->unlit ? hg_clampf(emissive + color, 0, 1e9f) : out.emitted[c];
    }
    return out;
}

static void forget_materials(struct hg_host_surfaces *s)
{
    for (size_t i = 0; i < s->material_count; i++)
        hg_free(s->materials[i].mask);
    s->material_count = 0;
    s->has_masks = false;
}

static enum hg_status find_material(struct hg_host_surfaces *s, struct hg_textures *textures,
    const struct hg_material *m, uint32_t *index)
{
    const uint64_t id = m ? m->head.id : 0, revision = m ? m->head.revision : 0;
    for (*index = 0; *index < s->material_count; ++*index)
        if (s->materials[*index].id == id && s->materials[*index].revision == revision)
            return HG_OK;
    if (hg_grow(&s->materials, &s->material_capacity, s->material_count + 1, sizeof *s->materials))
        return HG_E_NOMEM;
    s->materials[s->material_count] = make_material(textures, m);
    s->has_masks |= s->materials[s->material_count++].mask != NULL;
    return HG_OK;
}

// --- pieces --------------------------------------------------------------------------------------

static void index_draws(struct hg_host_surfaces *s)
{
    for (uint32_t i = s->piece_count; i-- > 0;)
        s->first_pieces[s->pieces[i].draw] = i;
    for (uint32_t d = s->draw_count; d-- > 0;)
        if (s->first_pieces[d] == UINT32_MAX)
            s->first_pieces[d] = s->first_pieces[d + 1];
}

enum hg_status hg_host_surfaces_sync(struct hg_host_surfaces *s, const struct hg_geometry *geometry,
    const struct hg_ray_geometry *rays, struct hg_textures *textures)
{
    const uint32_t count = hg_ray_geometry_count(rays);
    const uint64_t rays_revision = hg_ray_geometry_revision(rays);
    const uint64_t geometry_revision = hg_geometry_revision(geometry);
    struct hg_gpu_geometry tables;
    s->pieces = hg_ray_geometry_pieces(rays);
    if (s->first_pieces && s->piece_count == count && s->rays_revision == rays_revision &&
        s->geometry_revision == geometry_revision)
        return HG_OK;
    s->rays_revision = s->geometry_revision = 0;
    s->built++;
    if (s->material_count > 2 * (size_t)count + 64) // most are of revisions that are gone
        forget_materials(s);
    hg_geometry_fill(geometry, &tables);
    uint32_t *materials = hg_calloc((size_t)count + 1, sizeof *materials);
    uint32_t *first = hg_calloc((size_t)tables.draw_count + 1, sizeof *first);
    hg_free(s->piece_materials);
    hg_free(s->first_pieces);
    s->piece_materials = materials;
    s->first_pieces = first;
    s->piece_count = count;
    s->draw_count = tables.draw_count;
    if (!materials || !first)
        return HG_E_NOMEM;
    memset(first, 0xff, tables.draw_count * sizeof *first);
    first[tables.draw_count] = count;
    for (uint32_t i = 0; i < count; i++) {
        struct hg_draw_info info;
        const bool known = hg_geometry_draw_info(geometry, s->pieces[i].draw, &info);
        if (find_material(s, textures, known ? info.material : NULL, &materials[i]))
            return HG_E_NOMEM;
    }
    index_draws(s);
    s->rays_revision = rays_revision;
    s->geometry_revision = geometry_revision;
    return HG_OK;
}

void hg_host_surfaces_finish(struct hg_host_surfaces *s)
{
    hg_free(s->piece_materials);
    hg_free(s->first_pieces);
    forget_materials(s);
    hg_free(s->materials);
    *s = (struct hg_host_surfaces){0};
}

// --- hits ----------------------------------------------------------------------------------------

// The last piece of the draw that begins at the primitive or before it.
static uint32_t find_piece(const struct hg_host_surfaces *s, const struct hg_gpu_hit *hit)
{
    uint32_t low = s->first_pieces[hit->draw], high = s->first_pieces[hit->draw + 1];
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (s->pieces[middle].first_primitive <= hit->primitive)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static void world_edge(
    const struct hg_ray_geometry_piece *p, const float *from, const float *to, float out[3])
{
    const float *m = p->world, d[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    for (int a = 0; a < 3; a++)
        out[a] = m[a] * d[0] + m[3 + a] * d[1] + m[6 + a] * d[2];
}

void hg_host_surface_at(const struct hg_host_surfaces *s, const struct hg_gpu_hit *hit,
    const float direction[3], struct hg_host_surface *out)
{
    const uint32_t i = find_piece(s, hit);
    const struct hg_ray_geometry_piece *p = &s->pieces[i];
    uint32_t triangle = hit->primitive - p->first_primitive;
    triangle = triangle < p->triangle_count ? triangle : 0;
    const uint32_t *v = p->indices + (size_t)triangle * 3;
    const float *corner = p->positions + (size_t)v[0] * 3;
    float a[3], b[3];
    world_edge(p, corner, p->positions + (size_t)v[1] * 3, a);
    world_edge(p, corner, p->positions + (size_t)v[2] * 3, b);
    hg_cross3(a, b, out->normal);
    hg_normalize3(out->normal);
    const float facing =
        hg_dot3(out->normal, direction) * ((p->flags & HG_DRAW_MIRRORED) ? -1.0f : 1.0f);
    out->material = &s->materials[s->piece_materials[i]];
    out->inner = facing > 0;
    out->back = facing > 0 && !out->material->double_sided && !(p->flags & HG_DRAW_DOUBLE_SIDED);
    out->layers = (p->flags & HG_DRAW_BLEND) != 0;
    if (hg_dot3(out->normal, direction) > 0)
        for (int k = 0; k < 3; k++)
            out->normal[k] = -out->normal[k];
}

// Of a vertex, in object space; false: only triangles have any.
static bool vertex_normal(const struct hg_ray_geometry_piece *p, uint32_t vertex, float out[3])
{
    if (p->vertices != NULL) {
        const uint32_t n = p->vertices[vertex].normal;
        hg_octahedral3(
            (float)(int16_t)(n & 0xffff) / 32767, (float)(int16_t)(n >> 16) / 32767, out);
    } else if (p->normals != NULL) {
        hg_copy3(p->normals + (size_t)vertex * 3, out);
    }
    return p->vertices != NULL || p->normals != NULL;
}

// By the cofactors of the matrix: its inverse transposed, but for the length.
static void world_normal(const struct hg_ray_geometry_piece *p, const float n[3], float out[3])
{
    const float *m = p->world;
    float cofactors[3][3];
    for (int a = 0; a < 3; a++)
        hg_cross3(m + (a + 1) % 3 * 3, m + (a + 2) % 3 * 3, cofactors[a]);
    for (int a = 0; a < 3; a++)
        out[a] = cofactors[0][a] * n[0] + cofactors[1][a] * n[1] + cofactors[2][a] * n[2];
    hg_normalize3(out);
}

void hg_host_surface_normal(const struct hg_host_surfaces *s, const struct hg_gpu_hit *hit,
    const float direction[3], const struct hg_host_surface *surface, float out[3])
{
    const struct hg_ray_geometry_piece *p = &s->pieces[find_piece(s, hit)];
    const uint32_t *v = p->indices + (size_t)(hit->primitive - p->first_primitive) * 3;
    const float weights[3] = {1 - hit->u - hit->v, hit->u, hit->v};
    float n[3] = {0}, corner[3];
    bool known = hit->primitive - p->first_primitive < p->triangle_count;
    for (int k = 0; k < 3 && known; k++) {
        known = vertex_normal(p, v[k], corner);
        if (known)
            hg_mad3(n, corner, weights[k], n);
    }
    world_normal(p, n, out);
    if (hg_dot3(out, surface->normal) < 0)
        for (int a = 0; a < 3; a++)
            out[a] = -out[a];
    if (!known || !(hg_dot3(out, direction) < -1e-3f))
        hg_copy3(surface->normal, out);
}

// Of a vertex; false: there are none that the host reads.
static bool vertex_uv(
    const struct hg_ray_geometry_piece *p, uint32_t vertex, uint32_t set, float out[2])
{
    if (p->vertices != NULL && set == 0)
        memcpy(out, &p->vertices[vertex].uv, 2 * sizeof *out);
    else if (p->uv[set] != NULL)
        memcpy(out, p->uv[set] + (size_t)vertex * 2, 2 * sizeof *out);
    return (p->vertices != NULL && set == 0) || p->uv[set] != NULL;
}

bool hg_host_surface_is_hole(const struct hg_host_surfaces *s, const struct hg_gpu_hit *hit)
{
    const uint32_t i = find_piece(s, hit);
    const struct hg_ray_geometry_piece *p = &s->pieces[i];
    const struct hg_host_mask *mask = s->materials[s->piece_materials[i]].mask;
    const uint32_t triangle = hit->primitive - p->first_primitive;
    if (mask == NULL || (p->flags & HG_DRAW_MASK) == 0 || triangle >= p->triangle_count)
        return false;
    const uint32_t *v = p->indices + (size_t)triangle * 3;
    const float weights[3] = {1 - hit->u - hit->v, hit->u, hit->v};
    float uv[2] = {0}, corner[2];
    for (int k = 0; k < 3; k++) {
        if (!vertex_uv(p, v[k], mask->place.uv_set == 1, corner))
            return false;
        uv[0] += weights[k] * corner[0];
        uv[1] += weights[k] * corner[1];
    }
    return hg_host_mask_has_hole(mask, uv);
}
