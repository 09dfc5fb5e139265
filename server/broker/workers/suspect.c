#include "server/broker/workers/suspect.h"

#include <stdio.h>
#include <string.h>

#include "base/sha256.h"

// Of data that are long: pieces at equal distances, the last one at the end.
enum { PIECES = 16, PIECE_BYTES = 4096 };

struct visit {
    bool (*take)(void *user, const struct hg_quarantine_entry *entry);
    void *user;
    struct hg_quarantine_entry entry;
};

static void name(struct visit *v, struct hgp_str text)
{
    snprintf(
        v->entry.what, sizeof v->entry.what, "%.*s", (int)text.size, text.size ? text.data : "");
}

static bool take(struct visit *v)
{
    return v->take(v->user, &v->entry);
}

// ---- files --------------------------------------------------------------------------------------

static void visit_path(struct visit *v, struct hgp_str path)
{
    name(v, path);
    if (hg_sha256(path.size ? path.data : "", path.size, v->entry.key) == HG_OK)
        take(v);
}

static void visit_load(struct visit *v, const struct hgp_asset_load *m)
{
    static const char many[] = "an asset of many files";
    if (!m->files.count) {
        visit_path(v, m->path);
        return;
    }
    for (uint32_t i = 0; i < m->files.count && i < HG_SUSPECT_FILES; i++) {
        name(v, m->files.items[i].uri);
        memcpy(v->entry.key, m->files.items[i].hash, 32);
        if (!take(v))
            return;
    }
    if (m->files.count > HG_SUSPECT_FILES)
        visit_path(v, hgp_str_make(many));
}

static void visit_environment(struct visit *v, const struct hgp_environment_set *m)
{
    if (m->has_path && !m->has_hash)
        visit_path(v, m->path);
    if (!m->has_hash)
        return;
    name(v, hgp_str_make("an environment"));
    memcpy(v->entry.key, m->hash, 32);
    take(v);
}

// ---- data ---------------------------------------------------------------------------------------

static void add(struct hg_sha256 *hasher, const void *data, size_t size)
{
    const uint8_t *bytes = data;
    uint64_t length = size;
    hg_sha256_update(hasher, &length, sizeof length);
    if (size <= PIECES * PIECE_BYTES) {
        if (size)
            hg_sha256_update(hasher, bytes, size);
        return;
    }
    for (size_t i = 0; i < PIECES; i++)
        hg_sha256_update(hasher, bytes + (size - PIECE_BYTES) / (PIECES - 1) * i, PIECE_BYTES);
}

static void add_bytes(struct hg_sha256 *hasher, struct hgp_bytes bytes)
{
    add(hasher, bytes.data, bytes.size);
}

static void add_mesh(struct hg_sha256 *hasher, const struct hgp_mesh_set *m)
{
    for (uint32_t i = 0; i < m->parts.count; i++) {
        const struct hgp_mesh_part *part = &m->parts.items[i];
        const struct hgp_bytes all[] = {part->positions, part->normals, part->tangents, part->uv0,
            part->uv1, part->colors, part->indices};
        for (size_t k = 0; k < sizeof all / sizeof *all; k++)
            add_bytes(hasher, all[k]);
    }
}

static void add_texture(struct hg_sha256 *hasher, const struct hgp_texture_set *m)
{
    const uint32_t what[] = {(uint32_t)m->format, m->width, m->height};
    add(hasher, what, sizeof what);
    add_bytes(hasher, m->pixels);
}

static void add_comparison(struct hg_sha256 *hasher, const struct hgp_compare *m)
{
    const uint8_t metric = (uint8_t)m->metric;
    add(hasher, &metric, 1);
    add_bytes(hasher, m->a);
    add_bytes(hasher, m->b);
    if (m->has_mask)
        add_bytes(hasher, m->mask);
}

static bool is_query(uint16_t type)
{
    return type == HGP_T_pick || type == HGP_T_bounds_query || type == HGP_T_nodes_query ||
           type == HGP_T_info_query || type == HGP_T_box_select || type == HGP_T_surface_query ||
           type == HGP_T_measure;
}

static bool has_data(uint16_t type)
{
    return type == HGP_T_mesh_set || type == HGP_T_texture_set || type == HGP_T_compare ||
           type == HGP_T_image_query;
}

static void visit_data(struct visit *v, const struct hg_session *s, const struct hg_packet *packet,
    const union hgp_any *m)
{
    struct hg_sha256 *hasher = hg_sha256_create();
    const uint16_t type = packet->header.type;
    if (!hasher)
        return;
    add(hasher, &type, sizeof type);
    switch (type) {
    case HGP_T_mesh_set:
        add_mesh(hasher, &m->mesh_set);
        break;
    case HGP_T_texture_set:
        add_texture(hasher, &m->texture_set);
        break;
    case HGP_T_compare:
        add_comparison(hasher, &m->compare);
        break;
    case HGP_T_image_query:
        add_bytes(hasher, m->image_query.data);
        break;
    default:
        add(hasher, s->scene->name, strlen(s->scene->name));
        add(hasher, packet->payload, packet->header.length);
    }
    hg_sha256_end(hasher, v->entry.key);
    take(v);
}

// ---- all ----------------------------------------------------------------------------------------

void hg_suspect_each(const struct hg_session *s, const struct hg_packet *packet, bool only_known,
    bool (*take_one)(void *user, const struct hg_quarantine_entry *entry), void *user)
{
    const uint16_t type = packet->header.type;
    const bool is_load = type == HGP_T_asset_load || type == HGP_T_environment_set;
    const bool asks = is_query(type) && s->scene && s->scene->name[0];
    if (!is_load && !asks && !has_data(type))
        return;
    if (only_known && !s->table->quarantine->used)
        return;
    struct visit v = {.take = take_one, .user = user};
    snprintf(v.entry.tenant, sizeof v.entry.tenant, "%s", s->tenant);
    if (!is_load) // by that it is found before it is looked at
        snprintf(v.entry.what, sizeof v.entry.what, "%s of %u bytes", hgp_find(type)->name,
            packet->header.length);
    if (!is_load && only_known &&
        !hg_quarantine_has(s->table->quarantine, v.entry.tenant, v.entry.what))
        return;
    struct hg_arena arena = {0};
    union hgp_any any;
    if (hgp_decode(HGP_VERSION_MAX, type, hg_reader_make(packet->payload, packet->header.length),
            &arena, &any, NULL) == HG_OK) {
        if (type == HGP_T_asset_load)
            visit_load(&v, &any.asset_load);
        else if (type == HGP_T_environment_set)
            visit_environment(&v, &any.environment_set);
        else
            visit_data(&v, s, packet, &any);
    }
    hg_arena_finish(&arena);
}
