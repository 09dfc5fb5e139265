#include "client/cli/bench/bench_share.h"

#include <math.h>

enum { PARTS = HG_BENCH_SHARE_PARTS };
#define EDGE_VARIANCE (1.0 / 6) // of a count of regular frames in a window that begins anywhere

// Frames until then, and the part of the next one that has passed.
static double frames_until(const struct hg_bench_times *v, uint64_t begin_ns, uint64_t ns)
{
    uint32_t done = 0;
    while (done < v->count && v->ns[done] <= ns)
        done++;
    const uint64_t last_ns = done > 0 ? v->ns[done - 1] : begin_ns;
    const double since = (double)(ns - last_ns);
    double whole = v->count > 0 ? (double)(v->ns[v->count - 1] - begin_ns) / v->count : 0;
    if (done < v->count)
        whole = (double)(v->ns[done] - last_ns);
    return done + since / (whole > since ? whole : since + 1); // late: nearly there
}

static void count_parts(
    const struct hg_bench_times *v, uint64_t begin_ns, uint64_t end_ns, double frames[PARTS])
{
    double before = 0;
    for (int k = 0; k < PARTS; k++) {
        const uint64_t ns = begin_ns + (end_ns - begin_ns) / PARTS * (uint64_t)(k + 1);
        const double until = frames_until(v, begin_ns, ns);
        frames[k] = until - before;
        before = until;
    }
}

// Variance of the sum of a[k] - ratio b[k], whose mean is about 0.
static double variance(const double a[PARTS], const double b[PARTS], double ratio)
{
    double mean = 0, sum = 0;
    for (int k = 0; k < PARTS; k++)
        mean += (a[k] - ratio * b[k]) / PARTS;
    for (int k = 0; k < PARTS; k++) {
        const double d = a[k] - ratio * b[k] - mean;
        sum += d * d;
    }
    return sum * PARTS / (PARTS - 1);
}

// What the most of so many standard normal values is on average.
static double expected_most(uint32_t count)
{
    const double p = (count - 0.375) / (count + 0.25);
    double low = 0, high = 8;
    for (int i = 0; i < 50; i++) {
        const double x = (low + high) / 2;
        if (1 - 0.5 * erfc(x / sqrt(2)) < p)
            low = x;
        else
            high = x;
    }
    return low;
}

// Standard error of one viewer's share, over the mean share.
static double relative_error(
    const struct hg_bench_times *viewers, uint32_t count, uint64_t begin_ns, uint64_t end_ns)
{
    double all[PARTS] = {0}, sum = 0, total = 0, parts[PARTS];
    for (uint32_t i = 0; i < count; i++) {
        count_parts(&viewers[i], begin_ns, end_ns, parts);
        total += viewers[i].count;
        for (int k = 0; k < PARTS; k++)
            all[k] += parts[k] / count;
    }
    const double mean = total / count;
    for (uint32_t i = 0; i < count; i++) {
        count_parts(&viewers[i], begin_ns, end_ns, parts);
        sum += variance(parts, all, viewers[i].count / mean) + EDGE_VARIANCE;
    }
    return sqrt(sum / (count - 1)) / mean; // the mean has part of each in it
}

void hg_bench_shares(const struct hg_bench_times *viewers, uint32_t count, uint64_t begin_ns,
    uint64_t end_ns, struct hg_bench_shares *out)
{
    double of_least[PARTS], of_most[PARTS];
    uint32_t least = 0, most = 0;
    *out = (struct hg_bench_shares){.fairness = 1, .equal = 1};
    for (uint32_t i = 1; i < count; i++) {
        least = viewers[i].count < viewers[least].count ? i : least;
        most = viewers[i].count >= viewers[most].count ? i : most;
    }
    if (count == 0 || viewers[most].count == 0) {
        *out = (struct hg_bench_shares){.error = 1};
        return;
    }
    if (count == 1)
        return;
    const double ratio = (double)viewers[least].count / viewers[most].count;
    count_parts(&viewers[least], begin_ns, end_ns, of_least);
    count_parts(&viewers[most], begin_ns, end_ns, of_most);
    const double edges = EDGE_VARIANCE * (1 + ratio * ratio);
    const double scatter = relative_error(viewers, count, begin_ns, end_ns) * expected_most(count);
    out->fairness = ratio;
    out->error = sqrt(variance(of_least, of_most, ratio) + edges) / viewers[most].count;
    out->equal = scatter < 1 ? (1 - scatter) / (1 + scatter) : 0;
}
