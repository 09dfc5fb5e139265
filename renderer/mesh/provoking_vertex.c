// provoking_vertex.c - see provoking_vertex.h.
#include "renderer/mesh/provoking_vertex.h"

#include <string.h>

#include "base/alloc.h"

#define NONE UINT32_MAX

struct build {
    const struct hg_mesh_part *part;
    const uint32_t *order;
    uint32_t *place; // [part->vertex_count] vertex of the new list, or NONE
    struct hg_provoking *out;
};

static const uint32_t *corners_of(const struct build *b, uint32_t triangle)
{
    const size_t source = b->order != NULL ? b->order[triangle] : triangle;
    return b->part->indices + source * 3;
}

// The first corner of each triangle that is not the first of another one; else a copy of one.
static void choose_first(struct build *b, uint32_t triangles)
{
    for (uint32_t i = 0; i < triangles; i++) {
        const uint32_t *c = corners_of(b, i);
        uint32_t k = 0;
        while (k < 3 && b->place[c[k]] != NONE)
            k++;
        if (k < 3)
            b->place[c[k]] = i;
        else
            k = 0;
        b->out->sources[i] = c[k];
    }
    b->out->vertex_count = triangles;
}

// What is the first corner of no triangle comes behind.
static void place_others(struct build *b, uint32_t triangles)
{
    for (uint32_t i = 0; i < triangles; i++)
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t vertex = corners_of(b, i)[k];
            if (b->place[vertex] != NONE)
                continue;
            b->place[vertex] = b->out->vertex_count;
            b->out->sources[b->out->vertex_count++] = vertex;
        }
}

static void write_indices(const struct build *b, uint32_t triangles)
{
    for (uint32_t i = 0; i < triangles; i++) {
        const uint32_t *c = corners_of(b, i);
        uint32_t *to = b->out->indices + (size_t)i * 3;
        uint32_t first = 0;
        while (c[first] != b->out->sources[i])
            first++;
        to[0] = i;
        to[1] = b->place[c[(first + 1) % 3]];
        to[2] = b->place[c[(first + 2) % 3]];
    }
}

enum hg_status hg_provoking_build(
    const struct hg_mesh_part *part, const uint32_t *order, struct hg_provoking *out)
{
    const uint32_t triangles = part->index_count / 3;
    memset(out, 0, sizeof *out);
    if (part->vertex_count >= NONE - triangles)
        return HG_E_LIMIT;
    struct build b = {.part = part, .order = order, .out = out};
    b.place = hg_calloc(part->vertex_count, sizeof *b.place);
    out->indices = hg_calloc((size_t)triangles * 3, sizeof *out->indices);
    out->sources = hg_calloc((size_t)triangles + part->vertex_count, sizeof *out->sources);
    if (b.place == NULL || out->indices == NULL || out->sources == NULL) {
        hg_free(b.place);
        hg_provoking_finish(out);
        return HG_E_NOMEM;
    }
    memset(b.place, 0xff, part->vertex_count * sizeof *b.place);
    choose_first(&b, triangles);
    place_others(&b, triangles);
    write_indices(&b, triangles);
    hg_free(b.place);
    return HG_OK;
}

void hg_provoking_finish(struct hg_provoking *list)
{
    hg_free(list->indices);
    hg_free(list->sources);
    memset(list, 0, sizeof *list);
}
