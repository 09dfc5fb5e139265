#include "server/worker/view/view_memory.h"

#include <sys/resource.h>

#include "server/worker/view/view_slot.h"

// Measured with the demo scene, real time, of a worker with llvmpipe: 405 from 256 x 256 to 1024 x
// 1024, 462 from there to 2048 x 2048.
enum { PIXEL_BYTES = 480, SMALL_PART = 16 };

uint64_t hg_worker_memory_bytes(const struct render_state *s)
{
    struct rlimit limit;
    uint64_t bytes = s->w->options.memory_limit_bytes;
    if (getrlimit(RLIMIT_DATA, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY &&
        (!bytes || limit.rlim_cur < bytes))
        bytes = limit.rlim_cur;
    return bytes;
}

static uint64_t pixels_of(const struct session *session, const struct view_slot *without)
{
    uint64_t pixels = 0;
    for (const struct view_slot *it = session->views; it; it = it->next)
        if (it != without)
            pixels += (uint64_t)it->settings.params.width * it->settings.params.height;
    return pixels;
}

enum hg_status hg_view_memory_check(const struct render_state *s, const struct session *session,
    const struct view_slot *view, const struct hg_view_params *params, struct hg_error *err)
{
    const uint64_t most = hg_worker_memory_bytes(s) / 4 * 3 / PIXEL_BYTES,
                   small = most / SMALL_PART, pixels = (uint64_t)params->width * params->height,
                   own = pixels_of(session, view) + pixels;
    const struct hg_view_params *now = view ? &view->settings.params : NULL;
    uint64_t all = own, large = own > small ? own : 0;
    if (!most || (now && pixels <= (uint64_t)now->width * now->height) ||
        !hg_renderer_shares_memory(s->renderer))
        return HG_OK;
    for (const struct session *it = s->sessions; it; it = it->next) {
        const uint64_t others = it == session ? 0 : pixels_of(it, NULL);
        all += others;
        large += others > small ? others : 0;
    }
    if (all <= most && large <= most / 4 * 3)
        return HG_OK;
    hg_error_set(err, HG_E_LIMIT, "view_set", "width",
        "the worker has no memory for %llu pixels in views of this session: all may have %llu, "
        "and those with more than %llu together three quarters of that (memory-limit)",
        (unsigned long long)own, (unsigned long long)most, (unsigned long long)small);
    return hg_error_limit(err, "memory-limit", 0);
}
