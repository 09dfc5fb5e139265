// ray_geometry.c - see ray_geometry.h. What a draw shows is chosen as for a view that sees
// everything and waits for the whole of it (select.h).
#include "renderer/trace/ray_geometry.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/cull/select.h"

#define MOST_STUCK 2 // rounds of loading that bring nothing before the budget is too small

struct held {
    uint32_t number, chunk; // of the mesh
};

struct copy { // of what the host cannot read
    const struct hg_cluster_mesh *mesh;
    uint32_t chunk, first_piece, end_piece;
    uint8_t *bytes;
    enum hg_status status;
};

struct pose { // of a deformed part
    uint64_t node, mesh, mesh_revision;
    uint32_t part, vertex_count;
    uint64_t at; // floats
};

struct poses {
    struct pose *items;
    size_t capacity, float_capacity;
    uint32_t count;
    float *positions;
    uint64_t float_count;
};

struct placed {           // a draw
    uint64_t node, place; // place: part of the mesh, instance of the node
    float world[12];
};

struct hg_ray_geometry {
    struct hg_geometry *geometry;
    struct hg_selection runs;
    struct hg_ray_geometry_piece *pieces;
    size_t capacity;
    uint32_t count;
    struct held *held;
    size_t held_capacity;
    uint32_t held_count;
    struct copy *copies;
    size_t copy_capacity;
    uint32_t copy_count;
    struct poses opening, now; // now: where the host cannot read them
    struct placed *placed;     // at the opening of the shutter, in order
    size_t placed_capacity;
    uint32_t placed_count;
    double origin[3]; // that they are relative to
    uint32_t missing;
    uint64_t revision;
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "ray geometry", NULL, "no memory");
}

static bool host_reads(const struct hg_geometry *g)
{
    return hg_gpu_strategy(g->gpu)->host_reads && hg_gpu_get_caps(g->gpu)->mapped;
}

// --- life ----------------------------------------------------------------------------------------

static void drop_copies(struct hg_ray_geometry *c)
{
    for (uint32_t i = 0; i < c->copy_count; i++)
        hg_free(c->copies[i].bytes);
    c->copy_count = 0;
}

static void let_go(struct hg_ray_geometry *c)
{
    for (uint32_t i = 0; i < c->held_count; i++)
        hg_cluster_pool_let_go(c->geometry->pool, c->held[i].number, c->held[i].chunk);
    c->held_count = 0;
    c->count = 0;
}

static void poses_finish(struct poses *p)
{
    hg_free(p->items);
    hg_free(p->positions);
}

void hg_ray_geometry_free(struct hg_ray_geometry *c)
{
    if (c == NULL)
        return;
    let_go(c);
    drop_copies(c);
    hg_free(c->copies);
    hg_free(c->held);
    hg_free(c->pieces);
    hg_free(c->runs.items);
    hg_free(c->runs.wants);
    poses_finish(&c->opening);
    poses_finish(&c->now);
    hg_free(c->placed);
    hg_free(c);
}

static enum hg_status create(
    struct hg_geometry *geometry, struct hg_ray_geometry **out, struct hg_error *err)
{
    if (*out == NULL)
        *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return no_memory(err);
    (*out)->geometry = geometry;
    return HG_OK;
}

uint32_t hg_ray_geometry_count(const struct hg_ray_geometry *c)
{
    return c->count;
}

const struct hg_ray_geometry_piece *hg_ray_geometry_pieces(const struct hg_ray_geometry *c)
{
    return c->pieces;
}

uint32_t hg_ray_geometry_missing(const struct hg_ray_geometry *c)
{
    return c->missing;
}

uint64_t hg_ray_geometry_revision(const struct hg_ray_geometry *c)
{
    return c->revision;
}

// --- what there is to see ------------------------------------------------------------------------

static enum hg_status select_once(struct hg_ray_geometry *c, const struct hg_culling_view *view,
    struct hg_jobs *jobs, struct hg_error *err)
{
    c->runs.count = c->runs.want_count = 0;
    enum hg_status status = hg_select(c->geometry, view, jobs, &c->runs);
    if (status == HG_OK)
        status = hg_select_wants(c->geometry, view, &c->runs);
    return status == HG_OK ? HG_OK : hg_error_set(err, status, "ray geometry", NULL, "no memory");
}

// Uses resident chunks, and requests the rest.
static enum hg_status select_resident(struct hg_ray_geometry *c, const struct hg_culling_view *view,
    struct hg_jobs *jobs, struct hg_error *err)
{
    const enum hg_status status = select_once(c, view, jobs, err);
    c->missing = status == HG_OK ? c->runs.want_count : 0;
    if (c->missing > 0)
        (void)hg_cluster_pool_request(c->geometry->pool, c->runs.wants, c->missing);
    return status;
}

// Loads all chunks of the cut; evicts others where necessary.
static enum hg_status select_all(struct hg_ray_geometry *c, const struct hg_culling_view *view,
    struct hg_jobs *jobs, struct hg_error *err)
{
    struct hg_cluster_pool *pool = c->geometry->pool;
    enum hg_status status = select_once(c, view, jobs, err);
    for (uint32_t stuck = 0; status == HG_OK && c->runs.want_count > 0;) {
        const uint32_t before = c->runs.want_count;
        status = hg_cluster_pool_load(pool, c->runs.wants, before, true, err);
        if (status == HG_E_AGAIN) {
            hg_cluster_pool_tick(pool);
            status = HG_OK;
        }
        if (status == HG_OK)
            status = select_once(c, view, jobs, err);
        stuck = c->runs.want_count < before ? 0 : stuck + 1;
        if (status == HG_OK && c->runs.want_count > 0 && stuck > MOST_STUCK)
            return hg_error_set(err, HG_E_LIMIT, "geometry budget", NULL,
                "it does not hold what rays may meet: %u pieces of 128 KiB more are needed",
                c->runs.want_count);
    }
    return status;
}

static enum hg_status hold_chunks(struct hg_ray_geometry *c, struct hg_error *err)
{
    const struct hg_geometry *g = c->geometry;
    for (uint32_t i = 0; i < c->runs.count; i++) {
        const struct hg_run *run = &c->runs.items[i];
        if (run->chunk == HG_LOD_NONE ||
            (i > 0 && run->chunk == run[-1].chunk && run->draw == run[-1].draw))
            continue;
        struct hg_cluster_mesh *mesh = g->draws[run->draw].part->clusters;
        if (hg_grow(&c->held, &c->held_capacity, c->held_count + 1, sizeof *c->held) != HG_OK)
            return no_memory(err);
        hg_cluster_pool_hold(g->pool, mesh, run->chunk);
        c->held[c->held_count++] = (struct held){mesh->number, run->chunk};
    }
    return HG_OK;
}

// --- poses ---------------------------------------------------------------------------------------

static struct pose *find_pose(const struct poses *p, const struct hg_deform_entry *d)
{
    for (uint32_t low = 0, high = p->count; low < high;) { // in the order of deforms: node, part
        const uint32_t i = low + (high - low) / 2;
        struct pose *pose = &p->items[i];
        if (pose->node == d->node && pose->part == d->part)
            return pose->mesh == d->mesh && pose->mesh_revision == d->mesh_revision &&
                           pose->vertex_count == d->vertex_count
                       ? pose
                       : NULL;
        if (pose->node < d->node || (pose->node == d->node && pose->part < d->part))
            low = i + 1;
        else
            high = i;
    }
    return NULL;
}

static enum hg_status list_poses(struct hg_ray_geometry *c, struct poses *p, struct hg_error *err)
{
    const struct hg_geometry *g = c->geometry;
    p->count = 0;
    p->float_count = 0;
    if (hg_grow(&p->items, &p->capacity, g->deforms.count, sizeof *p->items) != HG_OK)
        return no_memory(err);
    for (uint32_t i = 0; i < g->deforms.count; i++) {
        const struct hg_deform_entry *d = &g->deforms.items[i];
        p->items[p->count++] = (struct pose){
            d->node, d->mesh, d->mesh_revision, d->part, d->vertex_count, p->float_count};
        p->float_count += (uint64_t)d->vertex_count * 3;
    }
    // One float of padding, for wide loads of the last position.
    if (hg_grow(&p->positions, &p->float_capacity, p->float_count + 1, sizeof(float)) != HG_OK) {
        p->count = 0;
        return no_memory(err);
    }
    return HG_OK;
}

// Positions of all poses to memory that the host reads.
static enum hg_status read_back(struct hg_geometry *g, struct poses *p, struct hg_error *err)
{
    struct hg_gpu_buffer to = {0};
    struct hg_gpu_cmd *cmd;
    enum hg_status status =
        hg_gpu_buffer_create(g->gpu, HG_GPU_BUFFER_READBACK, p->float_count * 4, "poses", &to, err);
    if (status != HG_OK)
        return status;
    status = hg_gpu_begin(g->gpu, &cmd, err);
    if (status == HG_OK) {
        hg_gpu_memory_barrier(cmd);
        for (uint32_t i = 0; i < p->count; i++) {
            const VkBufferCopy region = {
                0, p->items[i].at * 4, (uint64_t)p->items[i].vertex_count * 12};
            if (region.size > 0)
                vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), g->deforms.items[i].output.handle,
                    to.handle, 1, &region);
        }
        hg_gpu_memory_barrier(cmd);
        status = hg_gpu_submit_and_wait(g->gpu, cmd, err);
    }
    if (status == HG_OK)
        memcpy(p->positions, to.mapped, p->float_count * 4);
    hg_gpu_buffer_destroy(g->gpu, &to);
    return status;
}

static enum hg_status copy_poses(struct hg_ray_geometry *c, struct poses *p, struct hg_error *err)
{
    struct hg_geometry *g = c->geometry;
    enum hg_status status = list_poses(c, p, err);
    if (status != HG_OK || p->float_count == 0)
        return status;
    if (!host_reads(g))
        return read_back(g, p, err);
    for (uint32_t i = 0; i < p->count; i++)
        memcpy(p->positions + p->items[i].at, g->deforms.items[i].output.mapped,
            (size_t)p->items[i].vertex_count * 12);
    return HG_OK;
}

static int by_place(const void *a, const void *b)
{
    const struct placed *x = a, *y = b;
    if (x->node != y->node)
        return x->node < y->node ? -1 : 1;
    return x->place < y->place ? -1 : x->place > y->place;
}

static struct placed place_of(const struct hg_geometry *g, const struct hg_draw_entry *d)
{
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    struct placed p = {
        .node = d->node->head.id, .place = (uint64_t)d->mesh_part << 32 | d->instance};
    memcpy(p.world, instances[d->gpu.instance].world.m, sizeof p.world);
    return p;
}

static enum hg_status keep_places(struct hg_ray_geometry *c, struct hg_error *err)
{
    const struct hg_geometry *g = c->geometry;
    c->placed_count = 0;
    if (hg_grow(&c->placed, &c->placed_capacity, g->draw_count, sizeof *c->placed) != HG_OK)
        return no_memory(err);
    for (uint32_t i = 0; i < g->draw_count; i++)
        c->placed[c->placed_count++] = place_of(g, &g->draws[i]);
    if (c->placed_count > 0)
        qsort(c->placed, c->placed_count, sizeof *c->placed, by_place);
    memcpy(c->origin, g->origin, sizeof c->origin);
    return HG_OK;
}

enum hg_status hg_ray_geometry_open_shutter(
    struct hg_geometry *geometry, struct hg_ray_geometry **out, struct hg_error *err)
{
    enum hg_status status = create(geometry, out, err);
    if (status == HG_OK)
        status = copy_poses(*out, &(*out)->opening, err);
    if (status == HG_OK)
        status = keep_places(*out, err);
    if (status != HG_OK && *out != NULL)
        (*out)->opening.count = (*out)->placed_count = 0;
    return status;
}

// Where a draw was when the shutter opened, relative to the origin of now.
static void place_before(const struct hg_ray_geometry *c, const struct hg_draw_entry *d,
    struct hg_ray_geometry_piece *piece)
{
    const struct placed key = place_of(c->geometry, d);
    const struct placed *found =
        c->placed_count > 0 ? bsearch(&key, c->placed, c->placed_count, sizeof key, by_place)
                            : NULL;
    if (found == NULL)
        return;
    memcpy(piece->previous, found->world, sizeof piece->previous);
    for (int i = 0; i < 3; i++)
        piece->previous[9 + i] += (float)(c->origin[i] - c->geometry->origin[i]);
}

// --- pieces --------------------------------------------------------------------------------------

static uint64_t key_of(const struct hg_draw_entry *d, const struct hg_run *run)
{
    uint64_t h = hg_hash_mix(1, d->node->mesh->head.id);
    h = hg_hash_mix(h, d->node->mesh->head.revision);
    h = hg_hash_mix(h, (uint64_t)d->mesh_part << 32 | run->chunk);
    h = hg_hash_mix(h, (uint64_t)run->first << 32 | run->count);
    return d->deform != NULL ? hg_hash_mix(h, d->deform->node) : h;
}

static void fill_whole(const struct hg_ray_geometry *c, const struct hg_draw_entry *d,
    struct hg_ray_geometry_piece *piece)
{
    const struct hg_part_entry *part = d->part;
    const struct hg_mesh_part *source = part->proxy   ? part->proxy
                                        : part->discs ? part->discs
                                                      : &d->node->mesh->parts[d->mesh_part];
    const bool mapped = host_reads(c->geometry);
    piece->vertex_count = part->vertex_count;
    piece->indices = part->indices;
    piece->indices_address = part->buffer.address + part->layout.indices;
    piece->positions_address = part->buffer.address + part->layout.positions;
    piece->positions = mapped ? (const float *)part->buffer.mapped + part->layout.positions / 4
                              : source->positions;
    piece->normals = d->deform == NULL ? source->normals : NULL;
    piece->uv[0] = source->uv[0];
    piece->uv[1] = source->uv[1];
    if (d->deform == NULL)
        return;
    piece->deforms = true;
    piece->positions_address = d->deform->output.address;
    const struct pose *pose = mapped ? NULL : find_pose(&c->now, d->deform);
    piece->positions = mapped         ? d->deform->output.mapped
                       : pose != NULL ? c->now.positions + pose->at
                                      : NULL;
}

// The other vertex stream of a chunk, from its positions.
static const struct hg_gpu_vertex *vertices_of(
    const struct hg_lod *lod, uint32_t chunk, const float *positions)
{
    struct hg_lod_layout layout;
    hg_lod_chunk_layout(lod, chunk, &layout);
    const uint8_t *first = (const uint8_t *)(const void *)positions - layout.positions;
    return positions != NULL ? (const void *)(first + layout.vertices) : NULL;
}

static void fill_chunk(
    const struct hg_draw_entry *d, const struct hg_run *run, struct hg_ray_geometry_piece *piece)
{
    const struct hg_chunk_state *chunk = &d->part->clusters->chunks[run->chunk];
    piece->vertex_count = d->part->clusters->lod->chunks[run->chunk].vertex_count;
    piece->indices = chunk->indices;
    piece->positions = chunk->positions;
    piece->vertices = vertices_of(d->part->clusters->lod, run->chunk, chunk->positions);
    piece->indices_address = chunk->part.indices;
    piece->positions_address = chunk->part.positions;
}

static bool is_animated(const struct hg_node *node)
{
    while (node != NULL && !node->animated)
        node = node->parent;
    return node != NULL;
}

static void place_piece(const struct hg_ray_geometry *c, const struct hg_ray_geometry_lens *lens,
    const struct hg_draw_entry *d, struct hg_ray_geometry_piece *piece)
{
    const struct placed at = place_of(c->geometry, d);
    memcpy(piece->world, at.world, sizeof piece->world);
    memcpy(piece->previous, at.world, sizeof piece->previous);
    piece->animated = is_animated(d->node);
    if (!lens->motion)
        return;
    place_before(c, d, piece);
    const struct pose *pose = d->deform != NULL ? find_pose(&c->opening, d->deform) : NULL;
    piece->opening = pose != NULL ? c->opening.positions + pose->at : NULL;
}

static bool continues(const struct hg_run *run, const struct hg_run *before)
{
    return run->draw == before->draw && run->chunk == before->chunk &&
           run->first == before->first + before->count;
}

static enum hg_status add_piece(struct hg_ray_geometry *c, const struct hg_ray_geometry_lens *lens,
    const struct hg_run *run, struct hg_error *err)
{
    const struct hg_draw_entry *d = &c->geometry->draws[run->draw];
    if (hg_grow(&c->pieces, &c->capacity, c->count + 1, sizeof *c->pieces) != HG_OK)
        return no_memory(err);
    struct hg_ray_geometry_piece *piece = &c->pieces[c->count++];
    memset(piece, 0, sizeof *piece); // all bytes count in the revision
    piece->key = key_of(d, run);
    piece->draw = run->draw;
    piece->triangle_count = run->count;
    piece->flags = d->gpu.flags;
    piece->first_primitive =
        run->first + (run->chunk != HG_LOD_NONE ? run->chunk << HG_LOD_SHIFT : 0);
    if (run->chunk == HG_LOD_NONE)
        fill_whole(c, d, piece);
    else
        fill_chunk(d, run, piece);
    piece->indices_address += run->first * 12ull;
    if (piece->indices != NULL)
        piece->indices += run->first * 3ull;
    place_piece(c, lens, d, piece);
    return HG_OK;
}

// --- copies --------------------------------------------------------------------------------------

static void decode_copy(void *user, size_t index)
{
    struct copy *copy = &((struct hg_ray_geometry *)user)->copies[index];
    struct hg_lod_layout layout;
    struct hg_error ignored;
    hg_lod_chunk_layout(copy->mesh->lod, copy->chunk, &layout);
    copy->bytes = hg_calloc(layout.total_bytes, 1);
    copy->status = copy->bytes != NULL
                       ? hg_cluster_mesh_decode(copy->mesh, copy->chunk, copy->bytes, &ignored)
                       : HG_E_NOMEM;
}

static enum hg_status add_copy(
    struct hg_ray_geometry *c, const struct hg_run *run, struct hg_error *err)
{
    const struct hg_cluster_mesh *mesh = c->geometry->draws[run->draw].part->clusters;
    struct copy *last = c->copy_count > 0 ? &c->copies[c->copy_count - 1] : NULL;
    if (last != NULL && last->mesh == mesh && last->chunk == run->chunk &&
        last->end_piece == c->count - 1) {
        last->end_piece = c->count;
        return HG_OK;
    }
    if (hg_grow(&c->copies, &c->copy_capacity, c->copy_count + 1, sizeof *c->copies) != HG_OK)
        return no_memory(err);
    c->copies[c->copy_count++] = (struct copy){
        .mesh = mesh, .chunk = run->chunk, .first_piece = c->count - 1, .end_piece = c->count};
    return HG_OK;
}

// Positions of chunks, where the host cannot read those of the device.
static enum hg_status fill_copies(
    struct hg_ray_geometry *c, struct hg_jobs *jobs, struct hg_error *err)
{
    for (uint32_t i = 0; i < c->copy_count && jobs == NULL; i++)
        decode_copy(c, i);
    if (jobs != NULL)
        hg_jobs_for(jobs, c->copy_count, decode_copy, c);
    for (uint32_t i = 0; i < c->copy_count; i++) {
        const struct copy *copy = &c->copies[i];
        struct hg_lod_layout layout;
        if (copy->status != HG_OK)
            return hg_error_set(
                err, copy->status, "ray geometry", NULL, "a cluster could not be read");
        hg_lod_chunk_layout(copy->mesh->lod, copy->chunk, &layout);
        for (uint32_t p = copy->first_piece; p < copy->end_piece; p++) {
            c->pieces[p].positions = (const float *)(void *)(copy->bytes + layout.positions);
            c->pieces[p].vertices = (const void *)(copy->bytes + layout.vertices);
        }
    }
    return HG_OK;
}

// --- all of it
// ---------------------------------------------------------------------------------------

static enum hg_status list_pieces(struct hg_ray_geometry *c,
    const struct hg_ray_geometry_lens *lens, struct hg_jobs *jobs, struct hg_error *err)
{
    const bool copies = !lens->addresses && !host_reads(c->geometry);
    enum hg_status status = HG_OK;
    c->now.count = 0;
    if (copies)
        status = copy_poses(c, &c->now, err);
    for (uint32_t i = 0; i < c->runs.count && status == HG_OK; i++) {
        const struct hg_run *run = &c->runs.items[i];
        const struct hg_draw_entry *d = &c->geometry->draws[run->draw];
        if (run->count == 0 || (d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)) != 0)
            continue;
        struct hg_run joined = *run;
        for (; i + 1 < c->runs.count && continues(run + 1, run); run++, i++)
            joined.count += run[1].count;
        status = add_piece(c, lens, &joined, err);
        if (status == HG_OK && copies && joined.chunk != HG_LOD_NONE)
            status = add_copy(c, &joined, err);
    }
    return status == HG_OK ? fill_copies(c, jobs, err) : status;
}

static uint64_t revision_of(const struct hg_ray_geometry *c)
{
    uint64_t h = hg_hash_mix(2, c->count);
    bool deforms = false;
    for (uint32_t i = 0; i < c->count; i++) {
        h = hg_hash_mix_bytes(h, &c->pieces[i], sizeof c->pieces[i]);
        deforms = deforms || c->pieces[i].deforms;
    }
    return deforms ? hg_hash_mix(h, hg_geometry_shape_revision(c->geometry)) : h;
}

enum hg_status hg_ray_geometry_make(struct hg_geometry *geometry,
    const struct hg_ray_geometry_lens *lens, struct hg_jobs *jobs, struct hg_ray_geometry **out,
    struct hg_error *err)
{
    const struct hg_culling_view view = {.eye = {lens->eye[0], lens->eye[1], lens->eye[2]},
        .px_scale = lens->px_scale,
        .orthographic = lens->orthographic,
        .near = lens->near,
        .error_px = lens->error_px,
        .both_sides = true,
        .wait = !lens->resident,
        .whole = !lens->resident};
    enum hg_status status = create(geometry, out, err);
    if (status != HG_OK)
        return status;
    struct hg_ray_geometry *c = *out;
    let_go(c);
    drop_copies(c);
    c->missing = 0;
    status =
        lens->resident ? select_resident(c, &view, jobs, err) : select_all(c, &view, jobs, err);
    if (status == HG_OK)
        status = hold_chunks(c, err);
    if (status == HG_OK)
        status = list_pieces(c, lens, jobs, err);
    if (status != HG_OK)
        let_go(c);
    c->revision = revision_of(c);
    return status;
}
