// page_load.c - threads of page sources: decode images, then bake them into packs.
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/cond.h"
#include "base/log.h"
#include "renderer/texture/source/page_preview.h"

#define STREAM_BYTES ((size_t)8 << 20) // of rows read at once
#define MEMORY_TRIES 20
#define RETRY_NS     UINT64_C(100000000) // until a pack that another process bakes is looked for again

void hg_page_backing_unref(struct hg_page_sources *s, struct hg_page_backing *b)
{
    if (b == NULL || atomic_fetch_sub(&b->refs, 1) > 1)
        return;
    if (b->memory_bytes > 0) {
        pthread_mutex_lock(&s->lock);
        s->memory_bytes -= b->memory_bytes;
        pthread_cond_signal(&s->work);
        pthread_mutex_unlock(&s->lock);
    }
    hg_mips_finish(&b->mips);
    hg_page_pack_finish(&b->pack);
    if (b->file != NULL)
        hg_tile_cache_forget(s->tiles, b->file);
    hg_open_file_remove(b->file);
    hg_free(b->histograms);
    hg_free(b);
}

// --- what to do next -----------------------------------------------------------------------------

enum task { TASK_NONE, TASK_LOAD, TASK_BAKE, TASK_STREAM, TASK_REFUSE };

// Memory that an image takes while it is decoded: its pixels and the chain.
static uint64_t pixel_bytes(const struct hg_page_image *i)
{
    return (uint64_t)i->info.width * i->info.height * (i->info.is_float ? 16 : 4);
}

static uint64_t chain_bytes(const struct hg_page_image *i)
{
    return (uint64_t)i->info.width * i->info.height * i->chain.texel_bytes * 4 / 3 + 4096;
}

static bool is_idle(const struct hg_page_image *i, uint64_t now)
{
    return !i->busy && !i->failed && i->members != NULL && i->retry_ns <= now;
}

// Evicts the least recently used chain among those that no pack can replace, or that were never
// used.
static bool drop_oldest_chain(struct hg_page_sources *s, struct hg_page_backing **dropped)
{
    struct hg_page_image *oldest = NULL;
    for (struct hg_page_image *i = s->images; i != NULL; i = i->next)
        if (i->backing != NULL && i->backing->kind == HG_PAGES_IN_MEMORY && !i->busy &&
            (!hg_page_can_bake(s, i) || i->used_ns == 0) &&
            (oldest == NULL || i->used_ns < oldest->used_ns))
            oldest = i;
    if (oldest == NULL)
        return false;
    *dropped = oldest->backing;
    oldest->backing = NULL;
    oldest->wanted = oldest->bake_wanted = oldest->early = false;
    return true;
}

static bool is_large(const struct hg_page_sources *s, const struct hg_page_image *i)
{
    return pixel_bytes(i) > s->params.image_bytes;
}

static bool has_room(const struct hg_page_sources *s, const struct hg_page_image *i)
{
    return s->memory_bytes == 0 ||
           s->memory_bytes + chain_bytes(i) + pixel_bytes(i) <= s->params.memory_bytes;
}

// Work for an idle thread, the most urgent first.
struct work {
    struct hg_page_image *wanted, *early, *bake;
};

// Packs that a caller waits for, then the most used ones: a short-lived process bakes what the next
// one needs first.
static bool bakes_before(
    const struct hg_page_sources *s, const struct hg_page_image *a, const struct hg_page_image *b)
{
    if (b != NULL && s->linger_ns > 0) // as many as may be
        return hg_page_image_texels(a) < hg_page_image_texels(b);
    if (b == NULL || a->bake_wanted != b->bake_wanted)
        return b == NULL || a->bake_wanted;
    return a->reads > b->reads;
}

static struct work find_work(struct hg_page_sources *s, uint64_t now)
{
    struct work w = {0};
    for (struct hg_page_image *i = s->images; i != NULL; i = i->next) {
        if (!is_idle(i, now))
            continue;
        const bool none = i->backing == NULL;
        if (none && s->linger_ns > 0)
            continue;
        if (none && (i->wanted || i->bake_wanted))
            w.wanted = i;
        else if (none && i->early && !is_large(s, i) && has_room(s, i))
            w.early = i;
        else if (!none && i->backing->kind == HG_PAGES_IN_MEMORY && hg_page_can_bake(s, i) &&
                 (s->linger_ns == 0 || now < s->linger_ns) && bakes_before(s, i, w.bake))
            w.bake = i;
    }
    return w;
}

// The lock is held. Loading comes first while there is memory, then baking gives memory back.
static enum task choose(struct hg_page_sources *s, struct hg_page_image **image,
    struct hg_page_backing **dropped, uint64_t now)
{
    const struct work w = find_work(s, now);
    struct hg_page_image *load = w.wanted != NULL ? w.wanted : w.early;
    *image = load != NULL ? load : w.bake;
    if (load == NULL)
        return w.bake != NULL ? TASK_BAKE : TASK_NONE;
    if (is_large(s, load)) {
        if (hg_page_can_bake(s, load))
            return TASK_STREAM;
        if (chain_bytes(load) + pixel_bytes(load) > s->params.memory_bytes)
            return TASK_REFUSE;
    }
    if (has_room(s, load))
        return TASK_LOAD;
    *image = drop_oldest_chain(s, dropped) ? NULL : w.bake;
    return *image != NULL ? TASK_BAKE : TASK_NONE;
}

// Work for a thread that runs only while others wait for it: nothing that takes long.
static enum task choose_urgent(struct hg_page_sources *s, struct hg_page_image **image)
{
    const struct work w = find_work(s, hg_clock_now_ns());
    *image = w.wanted;
    return s->hurry > 0 && w.wanted != NULL && !is_large(s, w.wanted) && has_room(s, w.wanted)
               ? TASK_LOAD
               : TASK_NONE;
}

// --- loading -------------------------------------------------------------------------------------

enum hg_status hg_page_chain_mips(
    const struct hg_page_image *image, const struct hg_image *pixels, struct hg_mips *out)
{
    static const enum hg_texture_use uses[] = {[HG_MIP_PLAIN] = HG_TEXTURE_DATA,
        [HG_MIP_WEIGHTED] = HG_TEXTURE_BLEND,
        [HG_MIP_NORMAL] = HG_TEXTURE_NORMAL};
    const struct hg_mips_params params = {.srgb = image->chain.srgb,
        .half = image->pool == HG_POOL_FLOAT,
        .use = uses[image->chain.filter]};
    return hg_mips_build(pixels, &params, out);
}

static enum hg_status decode(struct hg_page_sources *s, struct hg_page_image *image,
    const struct hg_image_source *origin, struct hg_page_backing *b, struct hg_error *err)
{
    const struct hg_image *view;
    struct hg_image owned;
    enum hg_status status =
        hg_source_decode(origin, &image->info, &s->params.limits, &view, &owned, err);
    if (status != HG_OK)
        return status;
    status = hg_page_chain_mips(image, view, &b->mips);
    hg_image_finish(&owned);
    if (status == HG_OK && b->mips.texel_bytes == 4 && image->chain.filter == HG_MIP_WEIGHTED) {
        b->histograms = hg_calloc(1, sizeof *b->histograms);
        status = b->histograms != NULL ? HG_OK : HG_E_NOMEM;
        for (uint32_t i = 0; status == HG_OK && i < b->mips.count; i++)
            hg_mips_count_alpha(&b->mips, i, b->histograms->counts[i]);
    }
    return status == HG_OK
               ? HG_OK
               : hg_error_set(err, status, origin->label, NULL, "no memory for its mips");
}

static void note_memory(struct hg_page_sources *s, uint64_t more, uint64_t less)
{
    s->memory_bytes += more;
    if (s->memory_bytes > s->stats.memory_peak_bytes)
        s->stats.memory_peak_bytes = s->memory_bytes;
    // Tiles have what images leave.
    const uint64_t most = s->params.memory_bytes;
    hg_tile_cache_trim(s->tiles, most > s->memory_bytes ? most - s->memory_bytes : 0);
    s->memory_bytes -= less;
}

// The lock is held. Memory may come back: it is tried again some times, then the image is too
// large.
static void fail_image(
    struct hg_page_sources *s, struct hg_page_image *image, const struct hg_error *err)
{
    if (err->status == HG_E_NOMEM && image->tries++ < MEMORY_TRIES) {
        image->retry_ns = hg_clock_now_ns() + RETRY_NS;
        return;
    }
    image->failed = true;
    image->err = *err;
    if (err->status == HG_E_NOMEM)
        image->err.status = HG_E_LIMIT;
    s->stats.failed++;
    char text[512];
    hg_error_format(err, text, sizeof text);
    hg_warn(TEXTURE, "an image cannot be read: %s", text);
}

// A pack that another process has baked meanwhile.
static struct hg_page_backing *find_pack(struct hg_page_sources *s, struct hg_page_image *image)
{
    struct hg_page_backing *b = hg_calloc(1, sizeof *b);
    if (b == NULL)
        return NULL;
    atomic_init(&b->refs, 1);
    b->kind = HG_PAGES_IN_PACK;
    if (hg_page_pack_open(s->params.store, &image->chain, &b->pack, NULL) == HG_OK)
        return b;
    hg_free(b);
    return NULL;
}

// The lock is held on entry and exit; the image is busy.
static void load(struct hg_page_sources *s, struct hg_page_image *image)
{
    const uint64_t need = chain_bytes(image) + pixel_bytes(image);
    note_memory(s, need, 0);
    image->borrowed = image->members;
    const struct hg_image_source *origin = image->borrowed->origin;
    pthread_mutex_unlock(&s->lock);
    struct hg_error err = {0};
    struct hg_page_backing *b = hg_calloc(1, sizeof *b);
    enum hg_status status =
        b != NULL ? HG_OK : hg_error_set(&err, HG_E_NOMEM, "textures", NULL, "no memory");
    if (status == HG_OK) {
        atomic_init(&b->refs, 1);
        b->kind = HG_PAGES_IN_MEMORY;
        status = decode(s, image, origin, b, &err);
    }
    pthread_mutex_lock(&s->lock);
    image->borrowed = NULL;
    s->memory_bytes -= need;
    if (status == HG_OK) {
        b->memory_bytes = b->mips.bytes;
        note_memory(s, b->memory_bytes, 0);
        image->backing = b;
        image->used_ns = image->wanted ? hg_clock_now_ns() : 0;
        image->tries = 0;
        return;
    }
    if (b != NULL) {
        hg_mips_finish(&b->mips);
        hg_free(b->histograms);
        hg_free(b);
    }
    fail_image(s, image, &err);
}

// --- baking --------------------------------------------------------------------------------------

struct bake {
    struct hg_page_sources *sources;
    struct hg_page_image *image;
    struct hg_page_packer *packer;
};

static enum hg_status pack_row(void *user, uint32_t mip, uint32_t y, const void *texels)
{
    struct bake *b = user;
    if (mip == 0 && (atomic_load(&b->image->cancel) || b->sources->stop))
        return HG_E_CANCELLED;
    if (mip == 0 && y % HG_PAGE_TEXELS == 0) {
        pthread_mutex_lock(&b->sources->lock);
        const uint32_t rest = b->image->info.height - y;
        const uint64_t band =
            (uint64_t)b->image->info.width * (rest < HG_PAGE_TEXELS ? rest : HG_PAGE_TEXELS);
        b->image->texels_baked += band;
        b->sources->stats.bake_texels_done += band;
        pthread_mutex_unlock(&b->sources->lock);
    }
    return hg_page_packer_row(b->packer, mip, y, texels);
}

static enum hg_status pack_chain(struct bake *b, const struct hg_mips *mips)
{
    enum hg_status status = HG_OK;
    for (uint32_t m = 0; m < mips->count; m++) {
        const uint32_t h = hg_mips_side(mips->height, m);
        const size_t pitch = (size_t)hg_mips_side(mips->width, m) * mips->texel_bytes;
        for (uint32_t y = 0; y < h && status == HG_OK; y++)
            status = pack_row(b, m, y, mips->levels[m] + y * pitch);
    }
    return status;
}

// Rows of the image through the filters into the pack. *of_source: the image is to blame.
static enum hg_status pack_rows(
    struct bake *b, struct hg_source_rows *rows, bool *of_source, struct hg_error *err)
{
    const struct hg_page_image *image = b->image;
    const struct hg_mip_stream_params params = {.width = image->chain.width,
        .height = image->chain.height,
        .format = hg_source_rows_format(rows),
        .filter = image->chain.filter,
        .srgb = image->chain.srgb,
        .half = image->pool == HG_POOL_FLOAT,
        .row = pack_row,
        .user = b};
    const size_t row = (size_t)image->chain.width * hg_pixel_bytes(params.format);
    const uint32_t some = row > STREAM_BYTES / 256 ? (uint32_t)(STREAM_BYTES / row) + 1 : 256;
    struct hg_mip_stream *stream;
    enum hg_status status = hg_mip_stream_create(&params, &stream);
    uint8_t *pixels = hg_calloc(some, row);
    if (pixels == NULL)
        status = HG_E_NOMEM;
    for (uint32_t y = 0; y < params.height && status == HG_OK;) {
        const uint32_t count = params.height - y < some ? params.height - y : some;
        status = hg_source_rows_next(rows, count, pixels, err);
        *of_source = status != HG_OK;
        for (uint32_t i = 0; i < count && status == HG_OK; i++)
            status = hg_mip_stream_push(stream, pixels + i * row);
        y += count;
    }
    if (status == HG_OK) {
        status = hg_source_rows_check(rows, err);
        *of_source = status != HG_OK;
    }
    hg_free(pixels);
    hg_mip_stream_destroy(stream);
    return status;
}

static void account(struct bake *b, struct hg_source_rows *rows, bool more)
{
    const uint64_t bytes = hg_page_packer_bytes(b->packer) + 2 * STREAM_BYTES +
                           (rows != NULL ? hg_source_rows_bytes(rows) : 0);
    pthread_mutex_lock(&b->sources->lock);
    note_memory(b->sources, more ? bytes : 0, more ? 0 : bytes);
    pthread_mutex_unlock(&b->sources->lock);
}

// What a pack is made from: one of the two.
struct pack_input {
    const struct hg_mips *mips;  // a chain in memory
    struct hg_source_rows *rows; // of the image file
    bool failed;                 // out: reading the input failed, not writing the pack
};

static enum hg_status write_pack(struct hg_page_sources *s, struct hg_page_image *image,
    struct pack_input *from, struct hg_error *err)
{
    struct hg_store_key key;
    struct hg_store_writer *writer;
    struct bake b = {s, image, NULL};
    enum hg_status status = hg_page_pack_key(&image->chain, &key);
    if (status == HG_OK)
        status = hg_store_begin(s->params.store, &key, &writer, err);
    else
        hg_error_set(err, status, "pages", NULL, "no memory");
    if (status != HG_OK)
        return status;
    hg_store_label(
        writer, "texture %s: %u x %u", image->name, image->info.width, image->info.height);
    status = hg_page_packer_create(&image->chain, writer, s->jobs, &b.packer);
    if (status == HG_OK) {
        account(&b, from->rows, true);
        status = from->rows != NULL ? pack_rows(&b, from->rows, &from->failed, err)
                                    : pack_chain(&b, from->mips);
        account(&b, from->rows, false);
        if (status != HG_OK && err->status == HG_OK)
            *err = *hg_page_packer_error(b.packer);
    }
    if (status == HG_OK)
        status = hg_page_packer_end(b.packer, err);
    hg_page_packer_destroy(b.packer);
    if (status == HG_OK)
        return hg_store_commit(writer, err);
    if (err->status == HG_OK)
        hg_error_set(err, status, "pages", NULL, "%s", hg_status_text(status));
    hg_store_abort(writer);
    return status;
}

static void refuse_bake(
    struct hg_page_sources *s, struct hg_page_image *image, const struct hg_error *err)
{
    image->no_bake = true;
    image->err = *err;
    if (s->warned)
        return;
    s->warned = true;
    char text[512];
    hg_error_format(err, text, sizeof text);
    hg_warn(TEXTURE, "pages cannot be kept on disk: %s", text);
}

// Counts a bake that begins, or reverts that. The lock is held.
static void count_bake(struct hg_page_sources *s, struct hg_page_image *image, bool begins)
{
    const uint64_t texels = hg_page_image_texels(image);
    s->stats.bake_texels_total += begins ? texels : 0 - texels;
    s->stats.bake_texels_done -= begins ? 0 : image->texels_baked;
    image->texels_baked = 0;
}

// Records the result of a bake. The lock is held.
static void finish_bake(struct hg_page_sources *s, struct hg_page_image *image,
    enum hg_status status, struct hg_page_backing *pack, const struct hg_error *err)
{
    const bool found = status == HG_OK && image->bake.bake_ns == 0;
    if (status != HG_OK || found)
        count_bake(s, image, false);
    if (status == HG_OK) {
        image->backing = pack;
        s->stats.packs_found += found;
        s->stats.packs_baked += !found;
        s->stats.pages_baked += found ? 0 : image->layout.pages;
        s->stats.pack_bytes += hg_store_entry_bytes(pack->pack.entry);
        s->stats.bake_ns += image->bake.bake_ns;
    } else if (status == HG_E_BUSY || status == HG_E_CANCELLED) {
        image->retry_ns = hg_clock_now_ns() + RETRY_NS;
    } else {
        refuse_bake(s, image, err);
    }
}

// A pack that is there or is made now. Without the lock.
static enum hg_status make_pack(struct hg_page_sources *s, struct hg_page_image *image,
    struct pack_input *from, struct hg_page_backing **pack, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    image->bake.bake_ns = 0;
    *pack = find_pack(s, image);
    if (*pack != NULL)
        return HG_OK;
    const enum hg_status status = write_pack(s, image, from, err);
    if (status != HG_OK)
        return status;
    image->bake.bake_ns = hg_clock_now_ns() - start;
    *pack = find_pack(s, image);
    return *pack != NULL
               ? HG_OK
               : hg_error_set(err, HG_E_LIMIT, "pages", NULL, "the cache does not keep them");
}

// The lock is held on entry and exit; the image is busy and has its chain in memory.
static void bake(
    struct hg_page_sources *s, struct hg_page_image *image, struct hg_page_backing **dropped)
{
    struct hg_page_backing *chain = image->backing, *pack;
    atomic_fetch_add(&chain->refs, 1);
    count_bake(s, image, true);
    pthread_mutex_unlock(&s->lock);
    struct hg_error err = {0};
    struct pack_input from = {.mips = &chain->mips};
    const enum hg_status status = make_pack(s, image, &from, &pack, &err);
    hg_page_backing_unref(s, chain);
    pthread_mutex_lock(&s->lock);
    if (status == HG_OK)
        *dropped = image->backing;
    finish_bake(s, image, status, pack, &err);
}

// The lock is held on entry and exit; the image is busy and too large for memory.
static void stream(struct hg_page_sources *s, struct hg_page_image *image)
{
    count_bake(s, image, true);
    image->borrowed = image->members;
    const struct hg_image_source *origin = image->borrowed->origin;
    const bool shown = image->wanted && !image->bake_wanted && image->preview.count == 0;
    pthread_mutex_unlock(&s->lock);
    if (shown)
        hg_page_preview_read(s, image, origin);
    struct hg_error err = {0};
    struct pack_input from = {0};
    struct hg_page_backing *pack = NULL;
    enum hg_status status = hg_source_rows_open(origin, &image->info, &from.rows, &err);
    if (status == HG_OK)
        status = make_pack(s, image, &from, &pack, &err);
    else
        from.failed = true;
    hg_source_rows_close(from.rows);
    pthread_mutex_lock(&s->lock);
    image->borrowed = NULL;
    if (from.failed) {
        count_bake(s, image, false);
        fail_image(s, image, &err);
    } else {
        finish_bake(s, image, status, pack, &err);
    }
    if (image->backing != NULL || image->failed)
        hg_page_preview_drop(image);
}

static void refuse_image(struct hg_page_sources *s, struct hg_page_image *image)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_LIMIT, image->members->origin->label, NULL,
        "%u x %u texels do not fit into memory, and there is no cache folder for their pages",
        image->info.width, image->info.height);
    fail_image(s, image, &err);
}

// --- the thread ----------------------------------------------------------------------------------

// Waits for work, a short while when some is only put off.
static void wait_for_work(struct hg_page_sources *s)
{
    const uint64_t until_ns = hg_cond_after(RETRY_NS);
    for (const struct hg_page_image *i = s->images; i != NULL; i = i->next)
        if (i->retry_ns > 0 && !i->busy && !i->failed) {
            (void)hg_cond_wait(&s->work, &s->lock, until_ns);
            return;
        }
    pthread_cond_wait(&s->work, &s->lock);
}

static void work_on(struct hg_page_sources *s, struct hg_page_image *image, enum task task)
{
    struct hg_page_backing *dropped = NULL;
    const bool had_pages = image->backing != NULL;
    image->busy = true;
    image->retry_ns = 0;
    atomic_store(&image->cancel, false);
    if (task == TASK_LOAD)
        load(s, image);
    else if (task == TASK_BAKE)
        bake(s, image, &dropped);
    else if (task == TASK_STREAM)
        stream(s, image);
    else
        refuse_image(s, image);
    if (dropped != NULL) {
        pthread_mutex_unlock(&s->lock);
        hg_page_backing_unref(s, dropped);
        pthread_mutex_lock(&s->lock);
    }
    image->busy = false;
    hg_page_sources_changed(s, image->failed || (image->backing != NULL) != had_pages);
}

static void rush(struct hg_page_sources *s)
{
    while (!s->stop) {
        struct hg_page_image *image;
        const enum task task = choose_urgent(s, &image);
        if (task != TASK_NONE)
            work_on(s, image, task);
        else
            pthread_cond_wait(&s->rush, &s->lock);
    }
}

static void work_behind(struct hg_page_sources *s)
{
    while (!s->stop) {
        struct hg_page_image *image;
        struct hg_page_backing *dropped = NULL;
        const enum task task = choose(s, &image, &dropped, hg_clock_now_ns());
        if (task != TASK_NONE) {
            work_on(s, image, task);
        } else if (dropped != NULL) {
            pthread_mutex_unlock(&s->lock);
            hg_page_backing_unref(s, dropped);
            pthread_mutex_lock(&s->lock);
        } else {
            wait_for_work(s);
        }
    }
}

void *hg_page_load_thread(void *sources)
{
    struct hg_page_sources *s = sources;
    pthread_mutex_lock(&s->lock);
    const bool behind = s->started++ < s->params.threads;
    if (behind) // baking takes what the threads that draw leave
        setpriority(PRIO_PROCESS, 0, 10);
    if (behind)
        work_behind(s);
    else
        rush(s);
    pthread_mutex_unlock(&s->lock);
    return NULL;
}
