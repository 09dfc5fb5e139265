#include "server/broker/metrics/latency.h"

struct hg_latency hg_latencies[HG_LATENCY_STAGES];

const char *const hg_latency_stage_names[HG_LATENCY_STAGES] = {
    "input", "wait", "render", "read", "encode", "output", "all"};

const double hg_latency_bounds_s[HG_LATENCY_BUCKETS - 1] = {
    0.001, 0.002, 0.005, 0.01, 0.02, 0.035, 0.05, 0.1, 0.2, 0.5, 1};

static void add(struct hg_latency *l, uint64_t ns)
{
    uint32_t bucket = 0;
    while (bucket < HG_LATENCY_BUCKETS - 1 && (double)ns * 1e-9 > hg_latency_bounds_s[bucket])
        bucket++;
    l->counts[bucket]++;
    l->count++;
    l->sum_ns += ns;
}

void hg_latency_note(const struct hgp_frame *f, uint64_t sent_ns)
{
    const uint64_t times[HG_LATENCY_STAGES] = {f->input_ns, f->taken_ns, f->render_begin_ns,
        f->render_end_ns, f->encode_begin_ns, f->encode_end_ns, sent_ns};
    if (!f->has_input_ns || !f->has_taken_ns || !f->has_render_begin_ns || !f->has_render_end_ns ||
        !f->has_encode_begin_ns || !f->has_encode_end_ns)
        return;
    for (int i = 0; i + 1 < HG_LATENCY_STAGES; i++)
        if (times[i + 1] < times[i])
            return;
    for (int i = 0; i + 1 < HG_LATENCY_STAGES; i++)
        add(&hg_latencies[i], times[i + 1] - times[i]);
    add(&hg_latencies[HG_LATENCY_STAGES - 1], sent_ns - f->input_ns);
}
