// lod_bake.c - bakes every triangle part of an asset and says what it cost:
//     bench_lod_bake FILE|terrain:CELLS|points:COUNT [THREADS [TIMES [SPILL_FOLDER]]]
// Some lines per part, of the time that took the least CPU time; decoded and checked chunk by
// chunk.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/spill.h"
#include "renderer/lod/lod.h"
#include "renderer/scene/load.h"
#include "tests/unit/lod_meshes.h"
#include "tests/unit/lod_points.h"

static double peak_megabytes(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss * 1024e-6;
}

static double cpu_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static int decode_all(const struct hg_lod *lod, uint64_t *bytes, uint64_t *ns)
{
    uint8_t *slot = hg_calloc(1, HG_LOD_CHUNK_BYTES);
    struct hg_error err = {0};
    int failed = slot == NULL;
    const uint64_t start = hg_clock_now_ns();
    for (uint32_t i = 0; !failed && i < lod->chunk_count; i++) {
        struct hg_lod_layout layout;
        hg_lod_chunk_layout(lod, i, &layout);
        failed = hg_lod_decode(lod, i, lod->data + lod->chunks[i].offset, lod->chunks[i].bytes,
                     slot, &err) != HG_OK;
        *bytes += layout.total_bytes;
    }
    *ns += hg_clock_now_ns() - start;
    hg_free(slot);
    if (failed)
        fprintf(stderr, "decoding: %s\n", err.reason);
    return failed;
}

// FNV-1a of the bytes, to see whether two builds make the same.
static uint32_t hash_of(const uint8_t *data, size_t size)
{
    uint32_t h = 2166136261u;
    for (size_t i = 0; i < size; i++)
        h = (h ^ data[i]) * 16777619u;
    return h;
}

static void print_levels(const struct hg_lod *lod)
{
    for (uint32_t level = 0; level < lod->level_count; level++) {
        uint64_t triangles = 0, clusters = 0, groups = 0;
        float least = 3e38f, most = 0.0f;
        for (uint32_t g = 0; g < lod->group_count; g++) {
            const struct hg_lod_group *group = &lod->groups[g];
            if (group->level != level)
                continue;
            groups++;
            clusters += group->cluster_count;
            least = group->error < least ? group->error : least;
            most = group->error > most ? group->error : most;
            for (uint32_t c = 0; c < group->cluster_count; c++)
                triangles += lod->clusters[group->first_cluster + c].triangle_count;
        }
        printf("  level %2u: %8llu triangles %6llu clusters %5llu groups, error %g..%g\n", level,
            (unsigned long long)triangles, (unsigned long long)clusters, (unsigned long long)groups,
            (double)least, (double)most);
    }
}

struct result {
    struct hg_lod_report report;
    uint8_t *data;
    size_t size;
    double cpu; // seconds
};

static enum hg_status bake_once(
    const struct hg_mesh_part *part, struct hg_jobs *jobs, struct result *r, struct hg_error *err)
{
    struct hg_lod_params params = {.jobs = jobs};
    *r = (struct result){.cpu = cpu_seconds()};
    const enum hg_status status = hg_lod_bake(part, &params, &r->data, &r->size, &r->report, err);
    r->cpu = cpu_seconds() - r->cpu;
    return status;
}

// The one of `times` bakes that took the least CPU time.
static enum hg_status bake_best(const struct hg_mesh_part *part, struct hg_jobs *jobs, int times,
    struct result *best, struct hg_error *err)
{
    enum hg_status status = bake_once(part, jobs, best, err);
    for (int i = 1; status == HG_OK && i < times; i++) {
        struct result r;
        status = bake_once(part, jobs, &r, err);
        if (status == HG_OK && r.cpu < best->cpu) {
            hg_free(best->data);
            *best = r;
        } else {
            hg_free(r.data);
        }
    }
    return status;
}

static int bake(const struct hg_mesh_part *part, struct hg_jobs *jobs, int times)
{
    struct hg_error err = {0};
    struct hg_lod *lod = NULL;
    struct result best = {0};
    int failed = 1;
    if (bake_best(part, jobs, times, &best, &err) == HG_OK &&
        hg_lod_open(best.data, best.size, &lod, &err) == HG_OK) {
        uint64_t bytes = 0, ns = 0;
        const struct hg_lod_report r = best.report;
        const double cpu = best.cpu;
        failed = decode_all(lod, &bytes, &ns);
        const double s = (double)r.total_ns * 1e-9, t = (double)r.source_triangles;
        printf(
            "%llu triangles: %.2f s, %.3f Mtri per cpu second, %.2f bytes/triangle, %u clusters, "
            "%u groups, %u levels, %u chunks, peak %.0f MB\n",
            (unsigned long long)r.source_triangles, s, t / cpu * 1e-6, (double)r.file_bytes / t,
            r.clusters, r.groups, r.levels, r.chunks, (double)r.peak_bytes * 1e-6);
        printf(
            "  weld %.2f cut %.2f group %.2f simplify %.2f encode %.2f s; quantum %g; decode "
            "%.0f MB/s %.1f Mtri/s; stored/source %.2f; decoded %.1f B/stored; terminal %u; bytes "
            "%08x\n",
            (double)r.weld_ns * 1e-9, (double)r.cluster_ns * 1e-9, (double)r.group_ns * 1e-9,
            (double)r.simplify_ns * 1e-9, (double)r.encode_ns * 1e-9, (double)r.quantum,
            (double)bytes * 1e3 / (double)ns, (double)r.stored_triangles * 1e3 / (double)ns,
            (double)r.stored_triangles / t, (double)bytes / (double)r.stored_triangles,
            r.terminal_clusters, hash_of(best.data, best.size));
        print_levels(lod);
        printf("  processor %.2f s; peak of the process %.0f MB\n", cpu, peak_megabytes());
    } else {
        fprintf(stderr, "%s: %s\n", err.what, err.reason);
    }
    hg_lod_close(lod);
    hg_free(best.data);
    return failed;
}

static int bake_asset(const char *path, struct hg_jobs *jobs, int times)
{
    struct hg_asset *asset = NULL;
    struct hg_error err = {0};
    const struct hg_load_params params = {
        .path = path, .asset_number = 1, .scene_index = -1, .jobs = jobs};
    const uint64_t start = hg_clock_now_ns();
    if (hg_load_asset(&params, &asset, &err) != HG_OK) {
        fprintf(stderr, "%s: %s\n", err.what, err.reason);
        return 3;
    }
    printf("loaded in %.2f s\n", (double)(hg_clock_now_ns() - start) * 1e-9);
    int failed = 0;
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++)
            if (hg_lod_can_bake(&asset->meshes[m]->parts[p], asset->meshes[m]->target_count))
                failed |= bake(&asset->meshes[m]->parts[p], jobs, times);
    hg_asset_destroy(asset);
    return failed;
}

// A hilly square with colours and without normals, in no order; its arrays are spilled.
static struct hg_mesh_part scan(uint32_t count)
{
    struct hg_mesh_part p = {
        .topology = HG_TOPOLOGY_POINTS, .vertex_count = count, .index_count = count};
    uint32_t seed = 5;
    p.indices = hg_spill_calloc(count, 4);
    p.positions = hg_spill_calloc(count, 12);
    p.colors = hg_spill_calloc(count, 16);
    if (p.indices == NULL || p.positions == NULL || p.colors == NULL)
        abort();
    for (size_t i = 0; i < count; i++) {
        const float x = points_random(&seed), z = points_random(&seed);
        const float y = 0.1f * sinf(9.0f * x) * cosf(7.0f * z);
        p.indices[i] = (uint32_t)i;
        memcpy(p.positions + i * 3, (float[]){1000.0f * x, 1000.0f * y, 1000.0f * z}, 12);
        memcpy(p.colors + i * 4, (float[]){0.5f + y, x, z, 1.0f}, 16);
    }
    return p;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "usage: bench_lod_bake FILE|terrain:CELLS|points:COUNT [THREADS [TIMES "
                        "[SPILL_FOLDER]]]\n");
        return 2;
    }
    if (argc > 4)
        hg_spill_set_folder(argv[4]);
    struct hg_jobs *jobs = hg_jobs_create(argc > 2 ? (unsigned)atoi(argv[2]) : 1);
    if (jobs == NULL)
        return 1;
    const int times = argc > 3 ? atoi(argv[3]) : 1;
    int failed;
    if (strncmp(argv[1], "terrain:", 8) == 0) {
        struct hg_mesh_part part = lod_terrain((uint32_t)atoi(argv[1] + 8));
        failed = bake(&part, jobs, times);
        lod_part_finish(&part);
    } else if (strncmp(argv[1], "points:", 7) == 0) {
        hg_spill_begin("points");
        struct hg_mesh_part part = scan((uint32_t)atoi(argv[1] + 7));
        hg_spill_end();
        failed = bake(&part, jobs, times);
        points_finish(&part);
    } else {
        failed = bake_asset(argv[1], jobs, times);
    }
    hg_jobs_destroy(jobs);
    return failed;
}
