// cluster_pool.c - see cluster_mesh.h: slots, eviction, threads that decode.
#include "renderer/cluster/cluster_pool.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"

#define SLOT_BYTES  ((uint64_t)HG_LOD_CHUNK_BYTES)
#define BLOCK_SLOTS 64u // slots are allocated so many at once at most,
#define FIRST_SLOTS 4u  // at first so many, then half of what is there, so that little is too much
#define THREADS     2
#define MOST_QUEUED 32u
#define HYSTERESIS  30u // frames
#define MOST_KEPT   4096u

enum task_state { TASK_QUEUED, TASK_RUNNING, TASK_DONE };

struct task {
    struct task *next;
    struct hg_cluster_mesh *mesh;
    uint32_t chunk;
    enum task_state state;
    enum hg_status status;
    uint8_t *bytes;
    uint64_t ns;
};

struct block {
    struct hg_gpu_buffer buffer;
    uint32_t first, count; // slots
};

struct hg_cluster_pool {
    struct hg_gpu *gpu;
    struct hg_residency *residency;
    uint64_t budget_bytes;
    struct block *blocks; // by first slot
    size_t block_capacity;
    uint32_t block_count, slot_count, root_count, next_number, mark;
    struct hg_cluster_mesh **meshes; // by number
    size_t mesh_capacity;
    struct hg_cluster_pool_stats stats;

    pthread_mutex_t lock; // of what follows
    pthread_cond_t work, done;
    struct task *tasks, **last_task;
    uint32_t task_count;
    pthread_t threads[THREADS];
    uint32_t thread_count;
    bool stop;
};

static uint64_t key_of(const struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    return (uint64_t)mesh->number << 32 | chunk;
}

// --- decoding ------------------------------------------------------------------------------------

enum hg_status hg_cluster_mesh_decode(
    const struct hg_cluster_mesh *mesh, uint32_t chunk, uint8_t *dst, struct hg_error *err)
{
    const struct hg_lod_chunk *c = &mesh->lod->chunks[chunk];
    if (mesh->data != NULL)
        return hg_lod_decode(mesh->lod, chunk, mesh->data + c->offset, c->bytes, dst, err);
    uint8_t *encoded = hg_calloc(c->bytes, 1);
    if (encoded == NULL)
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    enum hg_status status = hg_lod_stored_read(&mesh->stored, chunk, encoded, err);
    if (status == HG_OK)
        status = hg_lod_decode(mesh->lod, chunk, encoded, c->bytes, dst, err);
    hg_free(encoded);
    return status;
}

static void run_task(struct task *task)
{
    const uint64_t start = hg_clock_now_ns();
    struct hg_lod_layout layout;
    struct hg_error ignored;
    hg_lod_chunk_layout(task->mesh->lod, task->chunk, &layout);
    task->bytes = hg_calloc(layout.total_bytes, 1);
    task->status = task->bytes == NULL
                       ? HG_E_NOMEM
                       : hg_cluster_mesh_decode(task->mesh, task->chunk, task->bytes, &ignored);
    task->ns = hg_clock_now_ns() - start;
}

static void *thread_main(void *user)
{
    struct hg_cluster_pool *p = user;
    pthread_mutex_lock(&p->lock);
    while (!p->stop) {
        struct task *task = p->tasks;
        while (task != NULL && task->state != TASK_QUEUED)
            task = task->next;
        if (task == NULL) {
            pthread_cond_wait(&p->work, &p->lock);
            continue;
        }
        task->state = TASK_RUNNING;
        pthread_mutex_unlock(&p->lock);
        run_task(task);
        pthread_mutex_lock(&p->lock);
        task->state = TASK_DONE;
        pthread_cond_broadcast(&p->done);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_cluster_pool_create(
    struct hg_gpu *gpu, struct hg_cluster_pool **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_cluster_pool *p = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    p->gpu = gpu;
    p->last_task = &p->tasks;
    const struct hg_residency_params params = {
        .slots = 0, .requests = MOST_KEPT, .hysteresis = HYSTERESIS};
    if (hg_residency_create(&params, &p->residency) != HG_OK) {
        hg_free(p);
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    }
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->work, NULL);
    pthread_cond_init(&p->done, NULL);
    while (p->thread_count < THREADS &&
           pthread_create(&p->threads[p->thread_count], NULL, thread_main, p) == 0)
        p->thread_count++;
    if (p->thread_count == 0) {
        hg_cluster_pool_destroy(p);
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no threads");
    }
    *out = p;
    return HG_OK;
}

static void free_task(struct task *task)
{
    hg_free(task->bytes);
    hg_free(task);
}

void hg_cluster_pool_destroy(struct hg_cluster_pool *p)
{
    if (p == NULL)
        return;
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_cond_broadcast(&p->work);
    pthread_mutex_unlock(&p->lock);
    for (uint32_t i = 0; i < p->thread_count; i++)
        pthread_join(p->threads[i], NULL);
    while (p->tasks != NULL) {
        struct task *next = p->tasks->next;
        free_task(p->tasks);
        p->tasks = next;
    }
    for (uint32_t i = 0; i < p->block_count; i++)
        hg_gpu_buffer_destroy(p->gpu, &p->blocks[i].buffer);
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->work);
    pthread_mutex_destroy(&p->lock);
    hg_residency_destroy(p->residency);
    hg_free(p->blocks);
    hg_free(p->meshes);
    hg_free(p);
}

struct hg_gpu *hg_cluster_pool_gpu(const struct hg_cluster_pool *p)
{
    return p->gpu;
}

uint32_t hg_cluster_pool_next_number(struct hg_cluster_pool *p)
{
    return p->next_number++;
}

void hg_cluster_pool_stats(const struct hg_cluster_pool *p, struct hg_cluster_pool_stats *out)
{
    struct hg_residency_stats r;
    hg_residency_stats(p->residency, &r);
    *out = p->stats;
    out->budget_bytes = p->budget_bytes;
    out->used_bytes = p->slot_count * SLOT_BYTES;
    out->root_bytes = p->root_count * SLOT_BYTES;
    out->resident = r.resident;
    out->requested = r.requested + r.in_flight;
    out->evicted = p->stats.evicted + r.evicted;
}

uint32_t hg_cluster_pool_mark(struct hg_cluster_pool *p)
{
    return p != NULL ? ++p->mark : 0;
}

// --- slots ---------------------------------------------------------------------------------------

static uint32_t slots_to_add(const struct hg_cluster_pool *p)
{
    const uint32_t half = p->slot_count / 2 > FIRST_SLOTS ? p->slot_count / 2 : FIRST_SLOTS;
    const uint32_t next = half < BLOCK_SLOTS ? half : BLOCK_SLOTS;
    if (p->budget_bytes == 0)
        return next;
    const uint64_t most = p->budget_bytes / SLOT_BYTES;
    const uint64_t left = most > p->slot_count ? most - p->slot_count : 0;
    return left < next ? (uint32_t)left : next;
}

static enum hg_status add_slots(struct hg_cluster_pool *p, uint32_t count, struct hg_error *err)
{
    if (hg_grow(&p->blocks, &p->block_capacity, p->block_count + 1, sizeof *p->blocks) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    struct block *block = &p->blocks[p->block_count];
    *block = (struct block){.first = p->slot_count, .count = count};
    enum hg_status status = hg_gpu_buffer_create(
        p->gpu, HG_GPU_BUFFER_DEVICE, count * SLOT_BYTES, "cluster chunks", &block->buffer, err);
    if (status != HG_OK)
        return status;
    status = hg_residency_resize(p->residency, p->slot_count + count);
    if (status != HG_OK) {
        hg_gpu_buffer_destroy(p->gpu, &block->buffer);
        return hg_error_set(err, status, "clusters", NULL, "no memory");
    }
    p->block_count++;
    p->slot_count += count;
    const uint64_t used = p->slot_count * SLOT_BYTES;
    p->stats.peak_bytes = used > p->stats.peak_bytes ? used : p->stats.peak_bytes;
    return HG_OK;
}

// The block that holds a slot, and where in it.
static const struct hg_gpu_buffer *block_of(
    const struct hg_cluster_pool *p, uint32_t slot, uint64_t *offset)
{
    uint32_t low = 0, high = p->block_count;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (p->blocks[middle].first <= slot)
            low = middle;
        else
            high = middle;
    }
    *offset = (slot - p->blocks[low].first) * SLOT_BYTES;
    return &p->blocks[low].buffer;
}

static struct hg_cluster_mesh *mesh_of(const struct hg_cluster_pool *p, uint64_t key)
{
    return p->meshes[key >> 32];
}

static void hold_parents(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    for (uint32_t i = mesh->parent_first[chunk]; i < mesh->parent_first[chunk + 1]; i++) {
        struct hg_chunk_state *parent = &mesh->chunks[mesh->parents[i]];
        if (parent->children++ == 0)
            hg_residency_pin(p->residency, parent->slot);
    }
}

static void let_parents_go(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    for (uint32_t i = mesh->parent_first[chunk]; i < mesh->parent_first[chunk + 1]; i++) {
        struct hg_chunk_state *parent = &mesh->chunks[mesh->parents[i]];
        if (--parent->children == 0 && parent->slot != HG_RESIDENCY_NONE)
            hg_residency_unpin(p->residency, parent->slot);
    }
}

static void leave_slot(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    c->slot = HG_RESIDENCY_NONE;
    hg_free(c->host_indices);
    c->host_indices = NULL;
    c->indices = NULL;
    c->positions = NULL;
    if (!c->loose)
        let_parents_go(p, mesh, chunk);
    c->loose = false;
}

static bool parents_are_resident(const struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    for (uint32_t i = mesh->parent_first[chunk]; i < mesh->parent_first[chunk + 1]; i++)
        if (!hg_chunk_is_bound(&mesh->chunks[mesh->parents[i]]))
            return false;
    return true;
}

// A loose chunk whose parents have come.
static bool bind(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    if (c->slot == HG_RESIDENCY_NONE || !c->loose || !parents_are_resident(mesh, chunk))
        return false;
    hold_parents(p, mesh, chunk);
    c->loose = false;
    hg_residency_use(p->residency, c->slot);
    return true;
}

void hg_cluster_pool_loosen(struct hg_cluster_pool *p)
{
    for (uint32_t slot = 0; slot < p->slot_count; slot++) {
        const uint64_t key = hg_residency_item(p->residency, slot);
        const uint32_t chunk = (uint32_t)key;
        if (key == HG_RESIDENCY_NO_KEY)
            continue;
        struct hg_cluster_mesh *mesh = mesh_of(p, key);
        if (chunk < mesh->lod->root_chunk_count || mesh->chunks[chunk].loose)
            continue;
        let_parents_go(p, mesh, chunk);
        mesh->chunks[chunk].loose = true;
    }
}

// A slot for the chunk, which is then resident but not yet filled. Parents are pinned first, so
// that they are not what goes.
static enum hg_status take_slot(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh,
    uint32_t chunk, enum hg_residency_force force, struct hg_error *err)
{
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    uint64_t evicted;
    uint32_t slot;
    if (hg_grow(&p->meshes, &p->mesh_capacity, (size_t)mesh->number + 1, sizeof *p->meshes) !=
        HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    p->meshes[mesh->number] = mesh;
    if (!c->loose)
        hold_parents(p, mesh, chunk);
    enum hg_status status = HG_OK;
    struct hg_residency_stats r;
    hg_residency_stats(p->residency, &r);
    const uint32_t more = slots_to_add(p);
    if (r.resident == p->slot_count && more > 0)
        status = add_slots(p, more, err);
    if (status == HG_OK)
        status = hg_residency_place(p->residency, key_of(mesh, chunk), force, &slot, &evicted);
    if (status != HG_OK) {
        p->stats.full += status == HG_E_AGAIN;
        leave_slot(p, mesh, chunk);
        return status;
    }
    if (evicted != HG_RESIDENCY_NO_KEY)
        leave_slot(p, mesh_of(p, evicted), (uint32_t)evicted);
    c->slot = slot;
    if (c->held > 0)
        hg_residency_pin(p->residency, slot);
    return HG_OK;
}

// Bytes of the chunk in its slot become what draws read.
static enum hg_status fill_slot(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh,
    uint32_t chunk, const uint8_t *bytes, struct hg_error *err)
{
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    uint64_t offset;
    const struct hg_gpu_buffer *block = block_of(p, c->slot, &offset);
    const uint64_t at = block->address + offset;
    struct hg_lod_layout l;
    hg_lod_chunk_layout(mesh->lod, chunk, &l);
    enum hg_status status = hg_gpu_buffer_upload(p->gpu, block, offset, bytes, l.total_bytes, err);
    if (status != HG_OK)
        return status;
    c->part = (struct hg_gpu_part){.indices = at + l.indices,
        .positions = at + l.positions,
        .vertices = at + l.vertices,
        .extra = at + l.extra};
    if (block->mapped != NULL && hg_gpu_strategy(p->gpu)->host_reads) {
        c->indices = (const uint32_t *)(void *)((uint8_t *)block->mapped + offset + l.indices);
        c->positions = (const float *)(void *)((uint8_t *)block->mapped + offset + l.positions);
    } else {
        const size_t size = (size_t)mesh->lod->chunks[chunk].index_count * 4;
        c->host_indices = hg_calloc(size, 1);
        if (c->host_indices == NULL)
            return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
        memcpy(c->host_indices, bytes + l.indices, size);
        c->indices = c->host_indices;
    }
    return hg_gpu_buffer_upload(
        p->gpu, &mesh->table, chunk * (uint64_t)sizeof c->part, &c->part, sizeof c->part, err);
}

// Makes a chunk resident whose parents are.
static enum hg_status settle(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh,
    uint32_t chunk, const uint8_t *bytes, enum hg_residency_force force, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = take_slot(p, mesh, chunk, force, err);
    if (status != HG_OK)
        return status;
    status = fill_slot(p, mesh, chunk, bytes, err);
    if (status != HG_OK) {
        hg_residency_remove(p->residency, mesh->chunks[chunk].slot);
        leave_slot(p, mesh, chunk);
        return status;
    }
    p->stats.upload_ns += hg_clock_now_ns() - start;
    p->stats.read_bytes += mesh->lod->chunks[chunk].bytes;
    return HG_OK;
}

// Evicts a slot's chunk, with the chunks that need it, unless one of them is pinned for good.
static bool empty_slot(struct hg_cluster_pool *p, uint32_t slot)
{
    const uint64_t key = hg_residency_item(p->residency, slot);
    if (key == HG_RESIDENCY_NO_KEY)
        return true;
    struct hg_cluster_mesh *mesh = mesh_of(p, key);
    const uint32_t chunk = (uint32_t)key;
    if (chunk < mesh->lod->root_chunk_count)
        return false;
    for (uint32_t c = chunk + 1; mesh->chunks[chunk].children > 0 && c < mesh->lod->chunk_count;
         c++) {
        bool needs = false;
        for (uint32_t i = mesh->parent_first[c]; i < mesh->parent_first[c + 1]; i++)
            needs = needs || mesh->parents[i] == chunk;
        if (needs && mesh->chunks[c].slot != HG_RESIDENCY_NONE)
            empty_slot(p, mesh->chunks[c].slot);
    }
    hg_residency_remove(p->residency, slot);
    leave_slot(p, mesh, chunk);
    p->stats.evicted++;
    return true;
}

// Gives back the last block. False when a root chunk is in it.
static bool drop_block(struct hg_cluster_pool *p)
{
    struct block *last = &p->blocks[p->block_count - 1];
    for (uint32_t i = 0; i < last->count; i++)
        if (!empty_slot(p, last->first + i))
            return false;
    if (hg_residency_resize(p->residency, last->first) != HG_OK)
        return false;
    hg_gpu_buffer_destroy(p->gpu, &last->buffer);
    p->slot_count = last->first;
    p->block_count--;
    return true;
}

void hg_cluster_pool_set_budget(struct hg_cluster_pool *p, uint64_t bytes)
{
    p->budget_bytes = bytes;
    while (bytes > 0 && p->block_count > 0 && p->slot_count * SLOT_BYTES > bytes)
        if (!drop_block(p))
            return;
}

void hg_cluster_pool_make_room(struct hg_cluster_pool *p, uint32_t count)
{
    const uint32_t room =
        slots_to_add(p) + hg_residency_available(p->residency, HG_RESIDENCY_UNUSED);
    if (p->budget_bytes > 0 && room < count)
        p->budget_bytes = (p->slot_count + slots_to_add(p) + count - room) * SLOT_BYTES;
}

void hg_cluster_pool_pin(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    hg_residency_pin(p->residency, mesh->chunks[chunk].slot);
    p->root_count++;
}

void hg_cluster_pool_hold(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    if (c->held++ == 0 && c->slot != HG_RESIDENCY_NONE)
        hg_residency_pin(p->residency, c->slot);
}

void hg_cluster_pool_let_go(struct hg_cluster_pool *p, uint32_t number, uint32_t chunk)
{
    struct hg_cluster_mesh *mesh = p->meshes[number]; // held, so it was placed
    if (mesh == NULL)
        return;
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    if (--c->held == 0 && c->slot != HG_RESIDENCY_NONE)
        hg_residency_unpin(p->residency, c->slot);
}

void hg_cluster_pool_use(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    hg_residency_use(p->residency, mesh->chunks[chunk].slot);
}

// --- tasks ---------------------------------------------------------------------------------------

// Takes a task that is over (or not begun) out of the list. With the lock held.
static void unlink_task(struct hg_cluster_pool *p, struct task *task)
{
    struct task **link = &p->tasks;
    while (*link != task)
        link = &(*link)->next;
    *link = task->next;
    if (p->last_task == &task->next)
        p->last_task = link;
    p->task_count--;
}

void hg_cluster_pool_forget(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh)
{
    pthread_mutex_lock(&p->lock);
    for (struct task *task = p->tasks; task != NULL;) {
        if (task->mesh != mesh) {
            task = task->next;
        } else if (task->state == TASK_RUNNING) {
            pthread_cond_wait(&p->done, &p->lock);
            task = p->tasks; // the list may be another one
        } else {
            struct task *next = task->next;
            unlink_task(p, task);
            hg_residency_cancel(p->residency, key_of(mesh, task->chunk));
            free_task(task);
            task = next;
        }
    }
    pthread_mutex_unlock(&p->lock);
    hg_residency_drop_requests(p->residency);
    if (mesh->chunks == NULL || mesh->parent_first == NULL)
        return;
    for (uint32_t c = mesh->lod->chunk_count; c > 0; c--) { // children before parents
        struct hg_chunk_state *state = &mesh->chunks[c - 1];
        const uint32_t slot = state->slot;
        if (slot == HG_RESIDENCY_NONE)
            continue;
        p->root_count -= c - 1 < mesh->lod->root_chunk_count;
        hg_residency_remove(p->residency, slot);
        leave_slot(p, mesh, c - 1);
    }
    if (mesh->number < p->mesh_capacity)
        p->meshes[mesh->number] = NULL;
}

static struct task *take_done(struct hg_cluster_pool *p)
{
    pthread_mutex_lock(&p->lock);
    struct task *task = p->tasks;
    while (task != NULL && task->state != TASK_DONE)
        task = task->next;
    if (task != NULL)
        unlink_task(p, task);
    pthread_mutex_unlock(&p->lock);
    return task;
}

bool hg_cluster_pool_tick(struct hg_cluster_pool *p)
{
    struct hg_error ignored;
    bool came = false;
    hg_residency_tick(p->residency);
    for (struct task *task = take_done(p); task != NULL; task = take_done(p)) {
        p->stats.decode_ns += task->ns;
        enum hg_status status = task->status;
        if (status == HG_OK && !parents_are_resident(task->mesh, task->chunk))
            status = HG_E_AGAIN; // a parent went: it is asked for again
        if (status == HG_OK)
            status = settle(p, task->mesh, task->chunk, task->bytes, HG_RESIDENCY_GENTLE, &ignored);
        if (status != HG_OK)
            hg_residency_cancel(p->residency, key_of(task->mesh, task->chunk));
        came = came || status == HG_OK;
        free_task(task);
    }
    return came;
}

static bool add_task(struct hg_cluster_pool *p, struct hg_cluster_mesh *mesh, uint32_t chunk)
{
    struct task *task = hg_calloc(1, sizeof *task);
    if (task == NULL)
        return false;
    *task = (struct task){.mesh = mesh, .chunk = chunk};
    pthread_mutex_lock(&p->lock);
    *p->last_task = task;
    p->last_task = &task->next;
    p->task_count++;
    pthread_cond_signal(&p->work);
    pthread_mutex_unlock(&p->lock);
    return true;
}

bool hg_cluster_pool_request(
    struct hg_cluster_pool *p, const struct hg_chunk_want *wants, uint32_t count)
{
    const uint64_t full = p->stats.full;
    uint32_t room = slots_to_add(p) + hg_residency_available(p->residency, HG_RESIDENCY_GENTLE);
    for (uint32_t i = 0; i < count; i++) {
        struct hg_cluster_mesh *mesh = wants[i].mesh;
        if (hg_grow(&p->meshes, &p->mesh_capacity, (size_t)mesh->number + 1, sizeof *p->meshes) !=
            HG_OK)
            return false;
        p->meshes[mesh->number] = mesh;
        if (!bind(p, mesh, wants[i].chunk) && parents_are_resident(mesh, wants[i].chunk))
            hg_residency_request(p->residency, key_of(mesh, wants[i].chunk), wants[i].priority);
    }
    uint64_t key;
    float priority;
    room = room < MOST_QUEUED ? room : MOST_QUEUED;
    while (p->task_count < room && hg_residency_next(p->residency, &key, &priority)) {
        if (!add_task(p, mesh_of(p, key), (uint32_t)key)) {
            hg_residency_cancel(p->residency, key);
            break;
        }
    }
    return p->stats.full != full || (count > 0 && room == 0);
}

// --- at once -------------------------------------------------------------------------------------

static int by_chunk(const void *a, const void *b)
{
    const struct hg_chunk_want *x = a, *y = b;
    if (x->mesh->number != y->mesh->number)
        return x->mesh->number < y->mesh->number ? -1 : 1;
    return x->chunk < y->chunk ? -1 : x->chunk > y->chunk; // coarse chunks come first
}

// Threads may be at it already: what they did is thrown away.
static enum hg_status load_one(struct hg_cluster_pool *p, const struct hg_chunk_want *want,
    bool loose, uint8_t *bytes, struct hg_error *err)
{
    struct hg_cluster_mesh *mesh = want->mesh;
    const uint32_t chunk = want->chunk;
    struct hg_chunk_state *c = &mesh->chunks[chunk];
    if (hg_chunk_is_bound(c) || (loose && c->slot != HG_RESIDENCY_NONE) || bind(p, mesh, chunk))
        return HG_OK;
    if (hg_residency_is_in_flight(p->residency, key_of(mesh, chunk)))
        return HG_E_AGAIN;
    if (c->slot != HG_RESIDENCY_NONE || !(loose || parents_are_resident(mesh, chunk)))
        return HG_E_AGAIN;
    if (slots_to_add(p) == 0 && hg_residency_available(p->residency, HG_RESIDENCY_UNUSED) == 0) {
        p->stats.full++;
        return HG_E_AGAIN;
    }
    const uint64_t start = hg_clock_now_ns();
    const enum hg_status status = hg_cluster_mesh_decode(mesh, chunk, bytes, err);
    p->stats.decode_ns += hg_clock_now_ns() - start;
    c->loose = status == HG_OK && loose; // also where parents are: they need not stay
    return status == HG_OK ? settle(p, mesh, chunk, bytes, HG_RESIDENCY_UNUSED, err) : status;
}

// What threads are at comes in first.
static void finish_tasks(struct hg_cluster_pool *p)
{
    pthread_mutex_lock(&p->lock);
    for (struct task *task = p->tasks; task != NULL;) {
        if (task->state == TASK_DONE) {
            task = task->next;
            continue;
        }
        pthread_cond_wait(&p->done, &p->lock);
        task = p->tasks;
    }
    pthread_mutex_unlock(&p->lock);
    for (struct task *task = take_done(p); task != NULL; task = take_done(p)) {
        hg_residency_cancel(p->residency, key_of(task->mesh, task->chunk));
        free_task(task);
    }
}

enum hg_status hg_cluster_pool_load(struct hg_cluster_pool *p, const struct hg_chunk_want *wants,
    uint32_t count, bool loose, struct hg_error *err)
{
    finish_tasks(p);
    struct hg_chunk_want *sorted = hg_calloc(count, sizeof *sorted);
    uint8_t *bytes = hg_calloc(HG_LOD_CHUNK_BYTES, 1);
    enum hg_status status = sorted != NULL && bytes != NULL
                                ? HG_OK
                                : hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    if (status == HG_OK) {
        memcpy(sorted, wants, count * sizeof *sorted);
        qsort(sorted, count, sizeof *sorted, by_chunk);
    }
    bool full = false;
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        status = load_one(p, &sorted[i], loose, bytes, err);
        full = full || status == HG_E_AGAIN;
        status = status == HG_E_AGAIN ? HG_OK : status;
    }
    hg_free(sorted);
    hg_free(bytes);
    return status == HG_OK && full ? HG_E_AGAIN : status;
}
