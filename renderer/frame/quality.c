#include "renderer/frame/quality.h"

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

static const float scales_of[] = {1.0f, 0.9f, 0.83f, 0.77f, 0.71f, 0.67f, 0.59f, 0.5f};
static const float rays_of[] = {1.0f, 0.5f, 0.25f};
#define SCALES  (sizeof scales_of / sizeof scales_of[0])
#define RAYS    (sizeof rays_of / sizeof rays_of[0])
#define FACTORS 11 // steps of sqrt(2)

static const struct hg_quality_choice full = {1.0f, 1.0f, 1.0f};

// Share of a part's time at full quality.
static float share(const struct hg_quality_choice *c, enum hg_quality_part part)
{
    return part == HG_QUALITY_PIXELS      ? c->scale * c->scale
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

// What is seen of a choice: halved sides cost most, halved rays (light that comes later) least.
static float loss(const struct hg_quality_choice *c)
{
    return -4.0f * log2f(c->scale) - 0.5f * log2f(c->rays) + 1.5f * log2f(c->factor);
}

// The choice of least loss that takes at most limit_ms, else the fastest.
static struct hg_quality_choice find(const struct hg_quality *q, float limit_ms, bool scales)
{
    struct hg_quality_choice best = full, fastest = full;
    float least = INFINITY, shortest = INFINITY;
    for (unsigned i = 0; i < (scales ? SCALES : 1) * RAYS * FACTORS; i++) {
        const struct hg_quality_choice c = {scales_of[i / (RAYS * FACTORS)],
            rays_of[i / FACTORS % RAYS], exp2f(0.5f * (float)(i % FACTORS))};
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

void hg_quality_note(struct hg_quality *q, const float *part_ms, float target_ms, bool scales)
{
    float frame_ms = 0.0f;
    if (target_ms <= 0.0f) {
        *q = (struct hg_quality){0};
        return;
    }
    if (q->now.scale <= 0.0f || (!scales && q->now.scale < 1.0f))
        change(q, full, false);
    for (int p = 0; p < HG_QUALITY_PARTS; p++)
        frame_ms += part_ms[p];
    learn(q, part_ms);
    q->since++;
    q->over = frame_ms > target_ms ? q->over + 1 : 0;
    if (q->on_trial && q->since > TRIAL) { // it held
        q->on_trial = false;
        q->wait /= 2;
    }
    if (q->over >= 2) {
        const struct hg_quality_choice cheaper = find(q, MARGIN * target_ms, scales);
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
    const struct hg_quality_choice better = find(q, ROOM * target_ms, scales);
    if (loss(&better) < loss(&q->now) && predict(q, &better) <= ROOM * target_ms)
        change(q, better, true);
}
