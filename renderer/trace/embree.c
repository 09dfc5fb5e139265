// embree.c - the backend of the host: its device, memory limit and waves. See trace.h.
#include "renderer/trace/embree.h"

#include <inttypes.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/jobs.h"

#define BLOCK_RAYS 1024u // of one job

// Embree's memory monitor: counts allocations and frees.
static bool monitor(void *user, ssize_t bytes, bool post)
{
    struct hg_embree *e = user;
    const int64_t now = atomic_fetch_add(&e->bytes, bytes) + bytes;
    if (bytes <= 0)
        return true;
    if (e->limit_bytes > 0 && now > e->limit_bytes) {
        atomic_store(&e->refused, true);
        if (!post) // it is not taken, so it will not be given back
            atomic_fetch_sub(&e->bytes, bytes);
        return false;
    }
    int64_t peak = atomic_load(&e->peak_bytes);
    while (now > peak && !atomic_compare_exchange_weak(&e->peak_bytes, &peak, now))
        ;
    return true;
}

enum hg_status hg_embree_check(struct hg_embree *e, struct hg_error *err)
{
    const enum RTCError error = rtcGetDeviceError(e->device);
    if (atomic_load(&e->refused))
        return hg_error_set(err, HG_E_LIMIT, "ray tracing budget", NULL,
            "%" PRId64 " bytes do not hold the structures of this scene", e->limit_bytes);
    if (error == RTC_ERROR_NONE)
        return HG_OK;
    if (error == RTC_ERROR_OUT_OF_MEMORY)
        return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
    return hg_error_set(
        err, HG_E_INTERNAL, "ray tracing", NULL, "Embree says error %d", (int)error);
}

static uint32_t packet_size(RTCDevice device)
{
    if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0)
        return 16;
    return rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0 ? 8 : 1;
}

static void destroy(void *self)
{
    struct hg_embree *e = self;
    if (e == NULL)
        return;
    hg_embree_clear(e);
    hg_free(e->instances);
    if (e->device != NULL)
        rtcReleaseDevice(e->device);
    hg_free(e);
}

static enum hg_status create(struct hg_trace *trace, void **self, struct hg_error *err)
{
    struct hg_embree *e = hg_calloc(1, sizeof *e);
    if (e == NULL)
        return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
    *self = e;
    e->trace = trace;
    e->limit_bytes = (int64_t)trace->params.budget_bytes;
    char config[32];
    snprintf(config, sizeof config, "threads=%u", hg_jobs_limit());
    e->device = rtcNewDevice(config);
    if (e->device == NULL)
        return hg_error_set(err, HG_E_DEVICE, "ray tracing", "embree", "it refuses this machine");
    if (rtcGetDeviceProperty(e->device, RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) == 0)
        return hg_error_set(
            err, HG_E_DEVICE, "ray tracing", "embree", "it was built without ray masks");
    rtcSetDeviceMemoryMonitorFunction(e->device, monitor, e);
    e->packet = packet_size(e->device);
    return HG_OK;
}

static enum hg_status sync(void *self, const struct hg_trace_layout *layout, struct hg_error *err)
{
    struct hg_embree *e = self;
    const enum hg_status status = hg_embree_build(e, layout, err);
    if (status != HG_OK)
        hg_embree_clear(e);
    e->trace->stats.bytes = (uint64_t)atomic_load(&e->bytes);
    e->trace->stats.peak_bytes = (uint64_t)atomic_load(&e->peak_bytes);
    return status;
}

// --- waves ---------------------------------------------------------------------------------------

struct run {
    const struct hg_embree *e;
    const struct hg_trace_wave *wave;
    bool any;
    uint32_t at, end;
};

static void run_block(void *user, size_t index)
{
    const struct run *run = user;
    const uint32_t first = run->at + (uint32_t)index * BLOCK_RAYS, left = run->end - first;
    hg_embree_trace(run->e, run->wave, run->any, first, left < BLOCK_RAYS ? left : BLOCK_RAYS);
}

static enum hg_status submit(
    void *self, const struct hg_trace_piece *piece, uint64_t *value, struct hg_error *err)
{
    const struct hg_embree *e = self;
    const struct hg_trace_wave *wave = piece->wave;
    (void)value;
    if (wave->rays->mapped == NULL || (piece->any ? wave->blocked : wave->hits)->mapped == NULL)
        return hg_error_set(
            err, HG_E_INVAL, "ray tracing", "embree", "the host cannot reach the wave");
    struct run run = {e, wave, piece->any, piece->at, piece->at + piece->count};
    const size_t blocks = (piece->count + BLOCK_RAYS - 1) / BLOCK_RAYS;
    if (e->trace->params.jobs != NULL)
        hg_jobs_for(e->trace->params.jobs, blocks, run_block, &run);
    else
        for (size_t i = 0; i < blocks; i++)
            run_block(&run, i);
    return HG_OK;
}

// --- raw -----------------------------------------------------------------------------------------

struct raw {
    struct run run;
    uint8_t *packets;
};

static uint8_t *packets_of(const struct raw *raw, size_t block)
{
    return raw->packets + block * (BLOCK_RAYS / HG_EMBREE_PACKET) * hg_embree_packet_bytes();
}

static void raw_block(void *user, size_t index)
{
    const struct raw *raw = user;
    const uint32_t left = raw->run.wave->count - (uint32_t)index * BLOCK_RAYS;
    hg_embree_walk(raw->run.e, raw->run.wave, raw->run.any, packets_of(raw, index),
        left < BLOCK_RAYS ? left : BLOCK_RAYS);
}

static enum hg_status trace_raw(
    void *self, const struct hg_trace_wave *wave, bool any, uint64_t *ns, struct hg_error *err)
{
    const struct hg_embree *e = self;
    struct raw raw = {.run = {.e = e, .wave = wave, .any = any}};
    const size_t blocks = (wave->count + BLOCK_RAYS - 1) / BLOCK_RAYS;
    raw.packets =
        hg_calloc_aligned(64, blocks * (BLOCK_RAYS / HG_EMBREE_PACKET) * hg_embree_packet_bytes());
    if (raw.packets == NULL)
        return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
    for (uint32_t i = 0; i < wave->count; i += BLOCK_RAYS)
        hg_embree_lay_out(e, wave, i, wave->count - i < BLOCK_RAYS ? wave->count - i : BLOCK_RAYS,
            packets_of(&raw, i / BLOCK_RAYS));
    const uint64_t start = hg_clock_now_ns();
    if (e->trace->params.jobs != NULL)
        hg_jobs_for(e->trace->params.jobs, blocks, raw_block, &raw);
    else
        for (size_t i = 0; i < blocks; i++)
            raw_block(&raw, i);
    *ns = hg_clock_now_ns() - start;
    hg_free(raw.packets);
    return HG_OK;
}

const struct hg_trace_ops hg_trace_embree = {
    .create = create, .destroy = destroy, .sync = sync, .submit = submit, .raw = trace_raw};
