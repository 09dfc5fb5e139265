#include "renderer/frame/quality/quality.h"

#include <math.h>

#define WEIGHT     0.3f  // of a new frame in the estimates
#define OUTLIER    2.0f  // times the estimate, at most: one slow frame does little harm
#define LEAST_MS   0.05f // of an estimate that outliers are measured by
#define MARGIN     0.95f // of the target that a cheaper choice aims at
#define ROOM       0.85f // and a better one
#define FIRST_WAIT 8u    // frames before a better choice
#define MOST_WAIT  512u
#define TRIAL      60u // frames in which a better choice may fail
// Time of geometry over the error: triangles fall with a power between 1 and 2 of it.
#define TRIANGLE_POWER 1.5f
// Of shading in a checkerboard: half, and depths of the pixels that are left out.
#define CHECKERED 0.55f

static const struct {
    float scale;
    bool checkerboard;
} sizes_of[] = {{1.0f, false}, {0.9f, false}, {0.83f, false}, {0.77f, false}, {0.71f, false},
    {0.67f, false}, {0.59f, false}, {0.5f, false}, {1.0f, true}};
static const float rays_of[] = {1.0f, 0.5f, 0.25f};
#define SIZES   (sizeof sizes_of / sizeof sizes_of[0])
#define RAYS    (sizeof rays_of / sizeof rays_of[0])
#define FACTORS 11 // steps of sqrt(2)

static const struct hg_quality_choice full = {1.0f, 1.0f, 1.0f, false};

// Share of a part's time at full quality.
static float share(const struct hg_quality_choice *c, enum hg_quality_part part)
{
    const float pixels = c->scale * c->scale;
    return part == HG_QUALITY_PIXELS      ? pixels
           : part == HG_QUALITY_SHADING   ? pixels * (c->checkerboard ? CHECKERED : 1.0f)
           : part == HG_QUALITY_RAYS      ? c->rays
           : part == HG_QUALITY_TRIANGLES ? powf(c->factor, -TRIANGLE_POWER)
                                          : 1.0f;
}

static float predict(const struct hg_quality *q, const struct hg_quality_choice *c)
{
    float ms = 0.0f;
    for (int p = 0; p < HG_QUALITY_PARTS; p++)
        ms += q->full_ms[p] * share(c, (enum hg_quality_part)p);
    return ms;
}

// What is seen of a choice: halved sides cost most, halved rays (light that comes later) least. A
// checkerboard is as far from settled pictures as 77 % of the sides are
// (docs/internals/temporal.md).
static float loss(const struct hg_quality_choice *c)
{
    return -4.0f * log2f(c->scale) - 0.5f * log2f(c->rays) + 1.5f * log2f(c->factor) +
           (c->checkerboard ? 1.5f : 0.0f);
}

static bool is_allowed(const struct hg_quality_choice *c, const struct hg_quality_levers *levers)
{
    return (levers->scale || c->scale == 1.0f) && (levers->checkerboard || !c->checkerboard) &&
           (levers->error || c->factor == 1.0f);
}

// The choice of least loss that takes at most limit_ms, else the fastest.
static struct hg_quality_choice find(
    const struct hg_quality *q, float limit_ms, const struct hg_quality_levers *levers)
{
    struct hg_quality_choice best = full, fastest = full;
    float least = INFINITY, shortest = INFINITY;
    for (unsigned i = 0; i < SIZES * RAYS * FACTORS; i++) {
        const unsigned size = i / (RAYS * FACTORS);
        const struct hg_quality_choice c = {sizes_of[size].scale, rays_of[i / FACTORS % RAYS],
            exp2f(0.5f * (float)(i % FACTORS)), sizes_of[size].checkerboard};
        if (!is_allowed(&c, levers))
            continue;
        const float ms = predict(q, &c), lost = loss(&c);
        if (ms <= limit_ms && lost < least) {
            best = c;
            least = lost;
        }
        if (ms + 1e-3f * limit_ms * lost < shortest) { // nothing is lost for next to no time
            fastest = c;
            shortest = ms + 1e-3f * limit_ms * lost;
        }
    }
    return least < INFINITY ? best : fastest;
}

struct hg_quality_choice hg_quality_choose(const struct hg_quality *q, float target_ms)
{
    return target_ms > 0.0f && q->now.scale > 0.0f ? q->now : full;
}

static void learn(struct hg_quality *q, const float *part_ms)
{
    for (int p = 0; p < HG_QUALITY_PARTS; p++) {
        const float ms = part_ms[p] / share(&q->now, (enum hg_quality_part)p);
        const float most = OUTLIER * fmaxf(q->full_ms[p], LEAST_MS);
        q->full_ms[p] =
            q->frames == 0 ? ms : q->full_ms[p] + WEIGHT * (fminf(ms, most) - q->full_ms[p]);
    }
    q->frames++;
}

static void change(struct hg_quality *q, struct hg_quality_choice to, bool better)
{
    q->now = to;
    q->since = q->over = 0;
    q->on_trial = better;
}

void hg_quality_note(struct hg_quality *q, const float *part_ms, float target_ms,
    const struct hg_quality_levers *levers)
{
    float frame_ms = 0.0f;
    if (target_ms <= 0.0f) {
        *q = (struct hg_quality){0};
        return;
    }
    if (q->now.scale <= 0.0f)
        change(q, full, false);
    for (int p = 0; p < HG_QUALITY_PARTS; p++)
        frame_ms += part_ms[p];
    learn(q, part_ms);
    if (!is_allowed(&q->now, levers)) // what it was drawn with is none any more
        change(q, full, false);
    q->since++;
    q->over = frame_ms > target_ms ? q->over + 1 : 0;
    if (q->on_trial && q->since > TRIAL) { // it held
        q->on_trial = false;
        q->wait /= 2;
    }
    if (q->over >= 2) {
        const struct hg_quality_choice cheaper = find(q, MARGIN * target_ms, levers);
        if (predict(q, &cheaper) >= predict(q, &q->now))
            return;
        q->wait = q->on_trial ? 2 * q->wait : q->wait;
        q->wait = q->wait < MOST_WAIT ? q->wait : MOST_WAIT;
        change(q, cheaper, false);
        return;
    }
    q->wait = q->wait > FIRST_WAIT ? q->wait : FIRST_WAIT;
    if (q->since < q->wait)
        return;
    const struct hg_quality_choice better = find(q, ROOM * target_ms, levers);
    if (loss(&better) < loss(&q->now) && predict(q, &better) <= ROOM * target_ms)
        change(q, better, true);
}
