// cluster_pool_stats.h - how full the pool of chunks is.
// Floor 2 (cluster).
#ifndef HG_RENDERER_CLUSTER_CLUSTER_POOL_STATS_H
#define HG_RENDERER_CLUSTER_CLUSTER_POOL_STATS_H

#include <stdint.h>

// Chunks of baked parts.
struct hg_cluster_pool_stats {
    uint64_t budget_bytes, used_bytes, peak_bytes; // of slots on the device
    uint64_t root_bytes;                           // of them, of coarsest levels: never evicted
    uint64_t resident, requested, evicted;         // chunks: now, now, since creation
    uint64_t read_bytes, decode_ns, upload_ns;     // since creation
    uint64_t full;                                 // times that no slot was to be had
};

#endif
