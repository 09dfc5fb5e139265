// build_queue.c - see build_queue.h.
#include "renderer/lod/build_queue.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/log.h"
#include "base/hash.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"

#define TABLE_BITS 6u        // at first
#define TELL_FROM  10000000u // indices, whose bake takes a minute
#define TRIM_FROM  500000u   // triangles, whose groups leave hundreds of megabytes free in the heap

struct task {
    struct task *next;
    struct task *beside;      // in the table of those that were not taken: of the render thread
    struct hg_mesh_part part; // owns its arrays
    char name[64];            // of the mesh
    struct hg_lod_built result;
};

struct queue {
    struct task *first, **last;
};

struct hg_lod_build_queue {
    struct hg_store *store;
    struct hg_jobs *jobs;
    pthread_t thread;
    pthread_mutex_t lock; // of what follows
    pthread_cond_t changed;
    struct queue todo, done;
    // Of the render thread: those that were not taken, [1 << pending_bits] lists by pending_slot.
    struct task **pending;
    uint32_t pending_bits, pending_count;
    atomic_bool stop;
};

static void push(struct queue *q, struct task *task)
{
    task->next = NULL;
    *q->last = task;
    q->last = &task->next;
}

static struct task *pop(struct queue *q)
{
    struct task *task = q->first;
    if (task == NULL)
        return NULL;
    q->first = task->next;
    if (q->first == NULL)
        q->last = &q->first;
    return task;
}

static void free_task(struct task *task)
{
    if (task == NULL)
        return;
    hg_mesh_part_finish(&task->part, 0);
    hg_lod_stored_close(&task->result.stored);
    hg_free(task->result.data);
    hg_free(task);
}

// --- the thread ----------------------------------------------------------------------------------

static bool may_go_on(void *user, uint64_t done, uint64_t total)
{
    (void)done;
    (void)total;
    return !atomic_load(&((struct hg_lod_build_queue *)user)->stop);
}

// A store that fails costs nothing but the next bake.
static void keep(struct hg_lod_build_queue *b, const struct hg_store_key *key, struct task *task)
{
    struct hg_lod_built *r = &task->result;
    struct hg_error err = {0};
    struct hg_lod_stored stored;
    if (hg_lod_stored_write(b->store, key, task->name, r->data, r->size, &err) != HG_OK ||
        hg_lod_stored_find(b->store, key, &stored, &err) != HG_OK) {
        if (task->part.index_count >= TELL_FROM)
            hg_warn(GEOMETRY, "levels of detail of '%s' are not kept and will be made again: %s",
                task->name, err.reason);
        return;
    }
    r->stored = stored;
    hg_free(r->data);
    r->data = NULL;
    r->size = 0;
}

static void bake(struct hg_lod_build_queue *b, struct task *task)
{
    struct hg_lod_built *r = &task->result;
    struct hg_store_key key;
    struct hg_error err;
    const struct hg_lod_params params = {
        .jobs = b->jobs, .progress = may_go_on, .progress_user = b};
    r->status = HG_E_NOTFOUND;
    const bool named = b->store != NULL && hg_lod_stored_key(&task->part, &params, &key) == HG_OK;
    if (named)
        r->status = hg_lod_stored_find(b->store, &key, &r->stored, &err);
    if (r->status == HG_OK)
        return;
    r->status = hg_lod_bake(&task->part, &params, &r->data, &r->size, NULL, &err);
    if (r->status == HG_OK && named)
        keep(b, &key, task);
    if (r->status != HG_OK && r->status != HG_E_CANCELLED)
        hg_warn(GEOMETRY, "a mesh part of %u triangles has no levels of detail: %s",
            task->part.index_count / 3, err.reason);
}

static void *thread_main(void *user)
{
    struct hg_lod_build_queue *b = user;
    pthread_mutex_lock(&b->lock);
    while (!atomic_load(&b->stop)) {
        struct task *task = pop(&b->todo);
        if (task == NULL) {
            pthread_cond_wait(&b->changed, &b->lock);
            continue;
        }
        pthread_mutex_unlock(&b->lock);
        hg_spill_begin(task->name);
        bake(b, task);
        const bool large = task->part.index_count / 3 >= TRIM_FROM;
        hg_mesh_part_finish(&task->part, 0);
        hg_spill_end();
        if (large)
            hg_alloc_trim();
        pthread_mutex_lock(&b->lock);
        push(&b->done, task);
        pthread_cond_broadcast(&b->changed);
    }
    pthread_mutex_unlock(&b->lock);
    return NULL;
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_lod_build_queue_create(struct hg_store *store, struct hg_jobs *jobs,
    struct hg_lod_build_queue **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_lod_build_queue *b = hg_calloc(1, sizeof *b);
    if (b == NULL)
        return hg_error_set(err, HG_E_NOMEM, "levels of detail", NULL, "no memory");
    b->pending_bits = TABLE_BITS;
    b->pending = hg_calloc(1u << TABLE_BITS, sizeof *b->pending);
    if (b->pending == NULL) {
        hg_free(b);
        return hg_error_set(err, HG_E_NOMEM, "levels of detail", NULL, "no memory");
    }
    b->store = store;
    b->jobs = jobs;
    b->todo.last = &b->todo.first;
    b->done.last = &b->done.first;
    pthread_mutex_init(&b->lock, NULL);
    hg_cond_init(&b->changed);
    if (pthread_create(&b->thread, NULL, thread_main, b) != 0) {
        pthread_cond_destroy(&b->changed);
        pthread_mutex_destroy(&b->lock);
        hg_free(b->pending);
        hg_free(b);
        return hg_error_set(err, HG_E_NOMEM, "levels of detail", NULL, "no thread");
    }
    *out = b;
    return HG_OK;
}

void hg_lod_build_queue_destroy(struct hg_lod_build_queue *b)
{
    if (b == NULL)
        return;
    pthread_mutex_lock(&b->lock);
    atomic_store(&b->stop, true);
    pthread_cond_broadcast(&b->changed);
    pthread_mutex_unlock(&b->lock);
    pthread_join(b->thread, NULL);
    while (b->todo.first != NULL)
        free_task(pop(&b->todo));
    while (b->done.first != NULL)
        free_task(pop(&b->done));
    pthread_cond_destroy(&b->changed);
    pthread_mutex_destroy(&b->lock);
    hg_free(b->pending);
    hg_free(b);
}

// --- the render thread ---------------------------------------------------------------------------

// Arrays of a mesh are no longer written: what is spilled is shared and not copied.
static bool copy_array(void *out, void *values, size_t count, size_t size)
{
    void *copy = NULL;
    if (hg_spill_share(values)) {
        copy = values;
    } else if (values != NULL) {
        copy = hg_calloc(count, size);
        if (copy == NULL)
            return false;
        memcpy(copy, values, count * size);
    }
    memcpy(out, &copy, sizeof copy);
    return true;
}

static bool copy_part(struct hg_mesh_part *to, const struct hg_mesh_part *from)
{
    const size_t n = from->vertex_count;
    to->topology = from->topology;
    to->vertex_count = from->vertex_count;
    to->index_count = from->index_count;
    to->point_scale = from->point_scale;
    to->point_diameter = from->point_diameter;
    memcpy(to->bounds_min, from->bounds_min, sizeof to->bounds_min);
    memcpy(to->bounds_max, from->bounds_max, sizeof to->bounds_max);
    return copy_array(&to->indices, from->indices, from->index_count, 4) &&
           copy_array(&to->positions, from->positions, n, 12) &&
           copy_array(&to->normals, from->normals, n, 12) &&
           copy_array(&to->tangents, from->tangents, n, 16) &&
           copy_array(&to->uv[0], from->uv[0], n, 8) && copy_array(&to->uv[1], from->uv[1], n, 8) &&
           copy_array(&to->colors, from->colors, n, 16);
}

static struct task **pending_slot(
    const struct hg_lod_build_queue *b, uint64_t id, uint64_t revision, uint32_t index)
{
    const uint64_t h = hg_hash_mix(hg_hash_mix(hg_hash_mix(0, id), revision), index);
    return &b->pending[h & ((1u << b->pending_bits) - 1)];
}

static struct task **slot_of(const struct hg_lod_build_queue *b, const struct task *task)
{
    return pending_slot(b, task->result.mesh, task->result.revision, task->result.part);
}

static bool is_pending(
    const struct hg_lod_build_queue *b, uint64_t id, uint64_t revision, uint32_t index)
{
    const struct task *t = *pending_slot(b, id, revision, index);
    while (t != NULL &&
           (t->result.mesh != id || t->result.revision != revision || t->result.part != index))
        t = t->beside;
    return t != NULL;
}

static void remember(struct hg_lod_build_queue *b, struct task *task)
{
    struct task **slot = slot_of(b, task);
    task->beside = *slot;
    *slot = task;
}

// Twice the lists, once there are as many tasks. Without memory they get longer.
static void grow_table(struct hg_lod_build_queue *b)
{
    struct task **old = b->pending, **twice = NULL;
    const uint32_t lists = 1u << b->pending_bits;
    if (b->pending_count < lists || (twice = hg_calloc(lists * 2ull, sizeof *twice)) == NULL)
        return;
    b->pending = twice;
    b->pending_bits++;
    for (uint32_t i = 0; i < lists; i++) {
        for (struct task *t = old[i], *next; t != NULL; t = next) {
            next = t->beside;
            remember(b, t);
        }
    }
    hg_free(old);
}

static void forget(struct hg_lod_build_queue *b, const struct task *task)
{
    struct task **link = slot_of(b, task);
    while (*link != task)
        link = &(*link)->beside;
    *link = task->beside;
    b->pending_count--;
}

enum hg_status hg_lod_build_queue_add(struct hg_lod_build_queue *b, const struct hg_mesh *mesh,
    uint64_t id, uint64_t revision, uint32_t index)
{
    if (is_pending(b, id, revision, index))
        return HG_OK;
    struct task *task = hg_calloc(1, sizeof *task);
    if (task == NULL || !copy_part(&task->part, &mesh->parts[index])) {
        free_task(task);
        return HG_E_NOMEM;
    }
    snprintf(task->name, sizeof task->name, "%s", mesh->head.name);
    task->result.mesh = id;
    task->result.revision = revision;
    task->result.part = index;
    grow_table(b);
    remember(b, task);
    b->pending_count++;
    pthread_mutex_lock(&b->lock);
    push(&b->todo, task);
    pthread_cond_broadcast(&b->changed);
    pthread_mutex_unlock(&b->lock);
    return HG_OK;
}

bool hg_lod_build_queue_take(
    struct hg_lod_build_queue *b, uint64_t until_ns, struct hg_lod_built *out)
{
    memset(out, 0, sizeof *out);
    if (b->pending_count == 0)
        return false;
    pthread_mutex_lock(&b->lock);
    struct task *task = pop(&b->done);
    while (task == NULL && hg_cond_wait(&b->changed, &b->lock, until_ns))
        task = pop(&b->done);
    pthread_mutex_unlock(&b->lock);
    if (task == NULL)
        return false;
    forget(b, task);
    *out = task->result;
    hg_free(task);
    return true;
}

uint32_t hg_lod_build_queue_pending(const struct hg_lod_build_queue *b)
{
    return b->pending_count;
}
