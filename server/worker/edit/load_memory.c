#include "server/worker/edit/load_memory.h"

#include "server/worker/view/view_memory.h"

static bool is_own(const struct session *session, const struct hg_asset *asset)
{
    return asset->number - session->first_id < session->id_count; // wraps around below
}

enum hg_status hg_load_memory_left(const struct render_state *s, const struct session *session,
    uint64_t *left_bytes, struct hg_error *err)
{
    const uint64_t may = hg_worker_memory_bytes(s), most = may / 4, most_of_all = may / 2;
    uint64_t own = 0, all = 0;
    *left_bytes = 0;
    if (!may || session->restoring)
        return HG_OK;
    for (const struct scene_slot *slot = s->scenes; slot; slot = slot->next)
        for (uint32_t i = 0; i < slot->scene->asset_count; i++) {
            const struct hg_asset *asset = slot->scene->assets[i];
            all += asset->file.resident_bytes;
            if (slot == session->scene && is_own(session, asset))
                own += asset->file.resident_bytes;
        }
    if (own < most && all < most_of_all) {
        *left_bytes = most - own < most_of_all - all ? most - own : most_of_all - all;
        return HG_OK;
    }
    hg_error_set(err, HG_E_LIMIT, "asset_load", NULL,
        "the files of this session take %llu MiB of memory and those of all %llu: a session may "
        "have %llu, and all together %llu (memory-limit)",
        (unsigned long long)(own >> 20), (unsigned long long)(all >> 20),
        (unsigned long long)(most >> 20), (unsigned long long)(most_of_all >> 20));
    return hg_error_limit(err, "memory-limit", 0);
}
