// task.c - loads and comparisons on threads of their own.
#include "server/worker/task.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/isolate.h"
#include "base/spill.h"
#include "base/log.h"
#include "base/sha256.h"
#include "renderer/image/metrics.h"
#include "server/worker/edit/asset_path.h"
#include "server/worker/encode/encode_request.h"

enum { PROGRESS_NS = 100 * 1000 * 1000 };
static const char demo[] = "demo:"; // the built-in scene

_Static_assert((int)HGP_up_axis_MINUS_Z + 1 == (int)HG_UP_MINUS_Z, "the same order, AUTO first");

// Axes of the protocol as the renderer numbers them.
static enum hg_up_axis up_axis_of(enum hgp_up_axis up)
{
    return (enum hg_up_axis)((int)up + 1);
}

// ---- assets -------------------------------------------------------------------------------------

static bool report_progress(void *user, const char *stage, uint64_t done, uint64_t total)
{
    struct task *task = user;
    uint64_t now = hg_clock_now_ns();
    hg_watch_go_on(&task->watch);
    if (now - task->progress_sent_ns >= PROGRESS_NS) {
        task->progress_sent_ns = now;
        hg_reply_progress(task->to, stage, done, total);
    }
    return !atomic_load(&task->cancel);
}

// Checks a stored upload against its hash, and copies it.
static enum hg_status take_upload(const char *path, const uint8_t hash[32], const uint8_t *data,
    size_t size, struct hg_refbuf **out, struct hg_error *err)
{
    uint8_t digest[32];
    enum hg_status status = hg_sha256(data, size, digest);
    if (status)
        return status;
    if (memcmp(digest, hash, 32) != 0)
        return hg_error_set(
            err, HG_E_HASH, path, NULL, "the stored upload is damaged; send it again");
    *out = hg_refbuf_create(size);
    if (!*out)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for %zu bytes", size);
    memcpy((*out)->data, data, size);
    return HG_OK;
}

static enum hg_status read_upload(const struct worker_options *options, const uint8_t hash[32],
    uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    char *path;
    uint8_t *data = NULL;
    size_t size = 0;
    *out = NULL;
    enum hg_status status = hg_asset_path_upload(options, hash, &path, err);
    if (status)
        return status;
    status = hg_file_read(path, limit_bytes, &data, &size, err);
    if (!status)
        status = take_upload(path, hash, data, size, out, err);
    if (status)
        hg_asset_path_hide(options, (struct hgp_str){0}, NULL, err);
    hg_free(data);
    hg_free(path);
    return status;
}

static enum hg_status fetch_upload(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    struct task *task = user;
    const struct hgp_asset_load *m = &task->message.asset_load;
    *out = NULL;
    for (uint32_t i = 0; i < m->files.count; i++) {
        const struct hgp_asset_file *file = &m->files.items[i];
        if (file->uri.size == strlen(uri) && memcmp(file->uri.data, uri, file->uri.size) == 0)
            return read_upload(&task->to.w->options, file->hash, limit_bytes, out, err);
    }
    return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "was not uploaded with the asset");
}

static bool is_demo(struct hgp_str path)
{
    return path.size == sizeof demo - 1 && memcmp(path.data, demo, sizeof demo - 1) == 0;
}

static const char *roots_of(const struct task *task)
{
    return task->roots ? (const char *)task->roots->data : NULL;
}

// What to load: the first of the uploaded files, the built-in scene, or a file under the roots.
static enum hg_status asset_path(struct task *task, char **path)
{
    const struct hgp_asset_load *m = &task->message.asset_load;
    if (!m->files.count && !is_demo(m->path))
        return hg_asset_path_resolve(
            &task->to.w->options, roots_of(task), m->path, path, &task->err);
    *path = m->files.count ? hg_strndup(m->files.items[0].uri.data, m->files.items[0].uri.size)
                           : hg_strdup(demo);
    return *path ? HG_OK
                 : hg_error_set(&task->err, HG_E_NOMEM, "asset_load", NULL, "no memory for a name");
}

// Says what that limit is here.
static void explain_limit(struct hg_error *err)
{
    const struct hg_error of_load = *err;
    if (strcmp(err->limit, HG_LOAD_LIMIT_RESIDENT) != 0)
        return;
    hg_error_set(err, HG_E_LIMIT, of_load.what, of_load.where,
        "%.120s; files of a session may have a quarter of its worker's memory, those of all half "
        "(memory-limit)",
        of_load.reason);
    (void)hg_error_limit(err, "memory-limit", 0);
}

static enum hg_status load_asset(struct task *task)
{
    const struct hgp_asset_load *m = &task->message.asset_load;
    const struct worker_options *options = &task->to.w->options;
    char *path;
    enum hg_status status = asset_path(task, &path);
    if (status)
        return status;
    const struct hg_load_params params = {
        .path = path,
        .roots = (const char *const *)options->asset_roots,
        .root_count = options->asset_root_count,
        .asset_number = m->asset,
        .scene_index = m->has_scene_index ? m->scene_index : -1,
        .up = up_axis_of(m->has_up ? m->up : HGP_up_axis_AUTO),
        .point_scale = m->has_point_scale ? m->point_scale : 0,
        .point_diameter = m->has_point_diameter ? m->point_diameter : 0,
        .resident_limit_bytes = task->memory_bytes,
        .jobs = task->jobs,
        .fetch = m->files.count ? fetch_upload : NULL,
        .fetch_user = task,
        .progress = report_progress,
        .progress_user = task,
    };
    status = hg_load_asset(&params, &task->asset, &task->err);
    if (status)
        explain_limit(&task->err);
    if (status)
        hg_asset_path_hide(
            options, m->files.count ? (struct hgp_str){0} : m->path, path, &task->err);
    hg_free(path);
    return status;
}

// ---- environment and comparison -----------------------------------------------------------------

// Between the steps of tasks that cannot be stopped inside one.
static enum hg_status go_on(struct task *task, const char *what)
{
    hg_watch_go_on(&task->watch);
    if (!atomic_load(&task->cancel))
        return HG_OK;
    return hg_error_set(&task->err, HG_E_CANCELLED, what, NULL, "the session ended");
}

// The content of the store has the hash that it is named by.
static enum hg_status verify_upload(const char *path, const uint8_t hash[32], struct hg_error *err)
{
    enum { CHUNK = 1 << 20 };
    uint8_t digest[32], *chunk = hg_calloc(CHUNK, 1);
    struct hg_sha256 *hasher = chunk ? hg_sha256_create() : NULL;
    int fd = hasher ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    ssize_t got = fd < 0 ? -1 : 1;
    while (got > 0 && (got = read(fd, chunk, CHUNK)) > 0)
        hg_sha256_update(hasher, chunk, (size_t)got);
    const int e = errno;
    if (hasher)
        hg_sha256_end(hasher, digest);
    if (fd >= 0)
        close(fd);
    hg_free(chunk);
    if (!hasher)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory to verify it");
    if (got < 0)
        return hg_error_set(
            err, hg_status_from_errno(e), path, NULL, "cannot be read: %s", strerror(e));
    return memcmp(digest, hash, 32) == 0 ? HG_OK
                                         : hg_error_set(err, HG_E_HASH, path, NULL,
                                               "the stored upload is damaged; send it again");
}

static enum hg_status load_environment(struct task *task)
{
    const struct hgp_environment_set *m = &task->message.environment_set;
    const struct worker_options *options = &task->to.w->options;
    char *path;
    enum hg_status status =
        m->has_hash ? hg_asset_path_upload(options, m->hash, &path, &task->err)
                    : hg_asset_path_resolve(options, roots_of(task), m->path, &path, &task->err);
    if (!status && m->has_hash)
        status = verify_upload(path, m->hash, &task->err);
    if (!status)
        status = hg_environment_file_read(path, &task->cancel, &task->environment, &task->err);
    if (status)
        hg_asset_path_hide(options, m->has_hash ? (struct hgp_str){0} : m->path, path, &task->err);
    hg_free(path);
    return status;
}

static enum hg_status read_side(struct hgp_bytes bytes, const char *name, bool as_float,
    struct hg_image *out, struct hg_error *err)
{
    return hg_image_read_memory(&(struct hg_image_bytes){bytes.data, bytes.size, name},
        as_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8, NULL, out, err);
}

// Half of what the worker may take, a quarter of the machine where no limit is set.
static uint64_t most_bytes(const struct worker_options *o)
{
    if (o->memory_limit_bytes)
        return o->memory_limit_bytes / 2;
    return (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE) / 4;
}

// Both images, the difference, the mask, and what the metric keeps of each pixel meanwhile.
static enum hg_status check_size(
    const struct task *task, const struct hg_image_info *side, bool as_float, struct hg_error *err)
{
    static const uint32_t kept[] = {[HG_METRIC_PSNR] = 4,
        [HG_METRIC_SSIM] = 48,
        [HG_METRIC_FLIP] = 84,
        [HG_METRIC_RMSE] = 4,
        [HG_METRIC_MAX] = 4};
    const struct hgp_compare *m = &task->message.compare;
    const uint64_t pixel = kept[m->metric] + 4 + (m->has_mask ? 4 : 0) + 2 * (as_float ? 16 : 4);
    const uint64_t bytes = (uint64_t)side->width * side->height * pixel;
    const uint64_t most = most_bytes(&task->to.w->options);
    if (bytes <= most)
        return HG_OK;
    const bool set = task->to.w->options.memory_limit_bytes > 0;
    hg_error_set(err, HG_E_LIMIT, "compare", NULL,
        "%u x %u pixels would take %llu MiB with this metric, more than the %llu that one "
        "comparison may have (%s); compare parts",
        side->width, side->height, (unsigned long long)(bytes >> 20),
        (unsigned long long)(most >> 20),
        set ? "half of memory-limit" : "a quarter of this machine's memory");
    return set ? hg_error_limit(err, "memory-limit", 0) : HG_E_LIMIT;
}

// Before it is decoded: what is as large as the pictures is within their limit.
static enum hg_status probe_mask(
    const struct hgp_compare *m, const struct hg_image_info *side, struct hg_error *err)
{
    struct hg_image_info mask;
    enum hg_status status = hg_image_probe_memory(
        &(struct hg_image_bytes){m->mask.data, m->mask.size, "mask"}, &mask, err);
    if (status || (mask.width == side->width && mask.height == side->height))
        return status;
    return hg_error_set(err, HG_E_INVAL, "compare", "mask",
        "%u x %u pixels for pictures of %u x %u", mask.width, mask.height, side->width,
        side->height);
}

// 8-bit pictures are compared as they are; anything deeper in float.
static enum hg_status probe_sides(struct task *task, bool *as_float, struct hg_error *err)
{
    const struct hgp_compare *m = &task->message.compare;
    struct hg_image_info a, b;
    enum hg_status status = hg_image_probe_memory(
        &(struct hg_image_bytes){m->a.data, m->a.size, "first image"}, &a, err);
    if (status)
        return status;
    status = hg_image_probe_memory(
        &(struct hg_image_bytes){m->b.data, m->b.size, "second image"}, &b, err);
    if (status)
        return status;
    status = m->has_mask ? probe_mask(m, &a, err) : HG_OK;
    if (status)
        return status;
    *as_float = a.is_float || b.is_float || a.is_16bit || b.is_16bit;
    status = check_size(task, &a, *as_float, err);
    return status ? status : check_size(task, &b, *as_float, err);
}

struct comparison {
    struct hg_image a, b, mask, diff;
};

static enum hg_status read_sides(struct task *task, struct comparison *c)
{
    const struct hgp_compare *m = &task->message.compare;
    bool as_float;
    enum hg_status status = probe_sides(task, &as_float, &task->err);
    if (status)
        return status;
    status = read_side(m->a, "first image", as_float, &c->a, &task->err);
    if (status)
        return status;
    status = go_on(task, "compare");
    if (status)
        return status;
    status = read_side(m->b, "second image", as_float, &c->b, &task->err);
    if (!status && m->has_mask)
        status = read_side(m->mask, "mask", false, &c->mask, &task->err);
    if (status)
        return status;
    return go_on(task, "compare");
}

static enum hg_status compare_sides(struct task *task, struct comparison *c)
{
    const struct hgp_compare *m = &task->message.compare;
    const struct hg_image_pair pair = {&c->a, &c->b, m->has_mask ? &c->mask : NULL};
    enum hg_status status = hg_image_compare(
        &pair, (enum hg_metric)m->metric, &task->value, m->want_diff ? &c->diff : NULL, &task->err);
    if (status)
        return status;
    status = go_on(task, "compare");
    if (status || !m->want_diff)
        return status;
    return hg_image_encode(&c->diff,
        &(struct hg_image_encode){.file = HG_IMAGE_PNG8, .opaque = true}, &task->diff, &task->err);
}

static enum hg_status compare_images(struct task *task)
{
    struct comparison c = {0};
    enum hg_status status = read_sides(task, &c);
    if (!status)
        status = compare_sides(task, &c);
    task->width = c.a.width;
    task->height = c.a.height;
    hg_image_finish(&c.a);
    hg_image_finish(&c.b);
    hg_image_finish(&c.mask);
    hg_image_finish(&c.diff);
    return status;
}

static enum hg_status examine_image(struct task *task)
{
    const struct hgp_bytes *one = &task->message.image_query.data;
    const bool parts = task->file.size > 0;
    hg_spill_begin("a file that is verified");
    const enum hg_status status =
        hg_image_examine(&(struct hg_image_bytes){parts ? task->file.data : one->data,
                             parts ? task->file.size : one->size, "image"},
            ENCODE_FRAME_KEY_ATTRIBUTE, NULL, &task->summary, &task->err);
    hg_spill_end();
    return status;
}

// ---- threads ------------------------------------------------------------------------------------

static void *task_main(void *arg)
{
    struct task *task = arg;
    struct watch_list *list = &task->to.w->watch;
    hg_watch_add(list, &task->watch);
    hg_watch_begin(&task->watch, (struct watch_work){task->to.channel, task->to.request, 0});
    hg_isolate_watch(&task->cancel);
    switch (task->kind) {
    case TASK_ASSET:
        task->status = load_asset(task);
        break;
    case TASK_ENVIRONMENT:
        task->status = load_environment(task);
        break;
    case TASK_COMPARE:
        task->status = compare_images(task);
        break;
    case TASK_IMAGE:
        task->status = examine_image(task);
        break;
    }
    hg_watch_remove(list, &task->watch);
    if (task->status && !task->err.status)
        hg_error_set(&task->err, task->status, NULL, NULL, "%s", hg_status_text(task->status));
    struct command *command = NULL;
    while (!command && !(command = hg_calloc(1, sizeof *command)))
        hg_clock_sleep_ns(PROGRESS_NS); // the result must come back; wait for memory
    command->task = task;
    while (hg_queue_push(&task->to.w->inbox, command) == HG_E_AGAIN)
        hg_clock_sleep_ns(1000000);
    return NULL;
}

enum hg_status hg_task_start(struct task *task)
{
    pthread_t thread;
    if (pthread_create(&thread, NULL, task_main, task) != 0)
        return HG_E_LIMIT;
    pthread_detach(thread);
    return HG_OK;
}

void hg_task_destroy(struct task *task)
{
    if (!task)
        return;
    hg_asset_destroy(task->asset);
    hg_environment_file_finish(&task->environment);
    hg_writer_finish(&task->diff);
    hg_writer_finish(&task->file);
    hg_arena_finish(&task->arena);
    hg_refbuf_unref(task->payload);
    hg_refbuf_unref(task->roots);
    hg_free(task);
}
