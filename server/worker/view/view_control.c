#include "server/worker/view/view_control.h"

#include <math.h>
#include <stddef.h>

#define WINDOW_NS     10000000000u // of the least round trip
#define FIRST_FLIGHTS 2u           // under way before anything is known
#define LEAST_BYTES   4096u        // of a frame whose duration says something of the rate
#define LEAST_SPAN_NS 200000u      // and of that duration
#define LEAST_WAIT_NS 1000000u     // a frame that takes less meets no bottleneck
#define PATIENCE_NS   30000000u    // that a frame may be late
#define WEIGHT        0.3          // of a new measure in a mean
#define FALL          0.5          // of a lower rate; a higher one may double it
#define SHARE         0.9          // of the interval that a frame may take on the wire
#define ROOM          0.8          // and one of better quality than the one before
#define LEAST_MS      4.0f         // of rendering
#define SLOW          1.5          // times the interval that an encoder takes
#define SLOW_FRAMES   10u          // of it, at least
#define POOR_QUALITY  40           // of JPEG
#define STILL_BYTES   1.5          // a pixel without loss, until one was sent
#define LEAST_REST_NS 200000000u   // before a frame without loss
#define MOST_REST_NS  3000000000u

// Size of a JPEG frame by its quality, as a share of that at 80: pictures of the built-in scene and
// of Sponza at 720p, about. What a view's frames really have is measured.
static const struct {
    uint8_t quality;
    double share;
} sizes[] = {{20, 0.33}, {30, 0.42}, {40, 0.50}, {50, 0.57}, {60, 0.66}, {70, 0.79}, {80, 1.0},
    {85, 1.22}, {90, 1.6}, {95, 2.4}, {100, 5.0}};
#define SIZES (sizeof sizes / sizeof *sizes)

static double share_of(uint8_t quality)
{
    if (quality <= sizes[0].quality)
        return sizes[0].share;
    size_t i = 1;
    while (i + 1 < SIZES && sizes[i].quality < quality)
        i++;
    const double t = (double)(quality - sizes[i - 1].quality) /
                     (double)(sizes[i].quality - sizes[i - 1].quality);
    return sizes[i - 1].share + t * (sizes[i].share - sizes[i - 1].share);
}

static void note(double *mean, double value)
{
    *mean = *mean > 0 ? *mean + WEIGHT * (value - *mean) : value;
}

// ---- frames under way ---------------------------------------------------------------------------

static struct hg_control_flight *flight(struct hg_control *c, uint32_t i)
{
    return &c->flights[(c->first + i) % HG_CONTROL_FLIGHTS];
}

static void drop_first(struct hg_control *c)
{
    c->first = (c->first + 1) % HG_CONTROL_FLIGHTS;
    c->count--;
}

uint64_t hg_control_bytes(const struct hg_control *c)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < c->count; i++)
        bytes += c->flights[(c->first + i) % HG_CONTROL_FLIGHTS].bytes;
    return bytes;
}

static uint64_t transfer_ns(const struct hg_control *c, double bytes)
{
    return c->rate > 0 ? (uint64_t)fmin(bytes / c->rate * 1e9, 1e15) : 0;
}

uint64_t hg_control_rest_ns(const struct hg_control *c, uint64_t pixels)
{
    const double bytes = c->still_bytes > 0 ? c->still_bytes : STILL_BYTES * (double)pixels;
    const uint64_t ns = c->informed ? transfer_ns(c, bytes) : 0;
    return ns < LEAST_REST_NS ? 0 : ns < MOST_REST_NS ? ns : MOST_REST_NS;
}

void hg_control_begin(struct hg_control *c, bool informed)
{
    c->informed = informed;
    c->first = c->count = 0;
    c->free_ns = c->acked_ns = 0;
    c->holds = false;
}

void hg_control_queued(struct hg_control *c, uint64_t number, uint64_t begin_ns, uint64_t read_ns)
{
    if (c->count == HG_CONTROL_FLIGHTS) // of a client that names none
        drop_first(c);
    *flight(c, c->count++) = (struct hg_control_flight){.number = number, .begin_ns = begin_ns};
    note(&c->read_ns, (double)read_ns);
}

void hg_control_sent(struct hg_control *c, const struct hg_control_sent *sent)
{
    if (sent->failed) {
        hg_control_begin(c, c->informed);
        return;
    }
    c->sent++;
    if (sent->lossy) {
        note(&c->encode_ns, (double)sent->encode_ns);
        note(&c->usual_bytes, (double)sent->bytes / share_of(sent->quality));
        c->encoded++;
    } else {
        note(&c->still_bytes, (double)sent->bytes);
    }
    struct hg_control_flight *f = NULL;
    for (uint32_t i = 0; i < c->count && !f; i++)
        f = flight(c, i)->number == sent->number ? flight(c, i) : NULL;
    if (!f || f->sent_ns)
        return;
    f->bytes = sent->bytes;
    f->sent_ns = sent->sent_ns;
    if (sent->lossy && sent->sent_ns > f->begin_ns)
        note(&c->work_ns, (double)(sent->sent_ns - f->begin_ns));
    c->free_ns = c->free_ns > sent->sent_ns ? c->free_ns : sent->sent_ns;
    c->free_ns += transfer_ns(c, (double)sent->bytes);
    if (c->rate > 0)
        f->expected_ns = c->free_ns + c->rtt.ns;
}

// ---- the network --------------------------------------------------------------------------------

static void note_least(struct hg_control_least *least, uint64_t ns, uint64_t now_ns)
{
    if (now_ns - least->since_ns > WINDOW_NS) {
        least->ns = least->next_ns;
        least->next_ns = 0;
        least->since_ns = now_ns;
    }
    if (!least->next_ns || ns < least->next_ns)
        least->next_ns = ns;
    if (!least->ns || ns < least->ns)
        least->ns = ns;
}

// Bytes a second that this frame shows; 0 = nothing. Where it came right behind the one before,
// the time between them; else the time that it took to arrive, or what its round trip took longer
// than the least one, whichever says less.
static double measure_rate(const struct hg_control *c, const struct hg_control_flight *f,
    const struct hg_control_delivery *d)
{
    const uint64_t least_ns = c->rtt.ns, took_ns = d->at_ns - f->sent_ns;
    const double bytes = (double)f->bytes;
    if (c->acked_ns > f->sent_ns + least_ns && d->at_ns > c->acked_ns + LEAST_SPAN_NS)
        return bytes / (double)(d->at_ns - c->acked_ns) * 1e9;
    const uint64_t wait_ns = took_ns > least_ns ? took_ns - least_ns : 0;
    const double by_wait = bytes / (double)(wait_ns > LEAST_WAIT_NS ? wait_ns : LEAST_WAIT_NS);
    const bool timed = d->begun_ns && d->received_ns > d->begun_ns + LEAST_SPAN_NS;
    const double by_span = timed && f->bytes >= LEAST_BYTES
                               ? bytes / (double)(d->received_ns - d->begun_ns)
                               : INFINITY;
    return fmin(by_wait, by_span) * 1e9;
}

static void note_rate(struct hg_control *c, double rate)
{
    if (c->rate <= 0)
        c->rate = rate;
    else if (rate > c->rate)
        c->rate = fmin(rate, 2 * c->rate);
    else
        c->rate += FALL * (rate - c->rate);
}

// When the bottleneck will have taken what is still under way: the frame that has come left it a
// round trip before.
static void note_free(struct hg_control *c, uint64_t at_ns)
{
    const uint64_t left_ns = at_ns > c->rtt.ns ? at_ns - c->rtt.ns : 0;
    c->free_ns = left_ns + transfer_ns(c, (double)hg_control_bytes(c));
    for (uint32_t i = 0; i < c->count; i++) {
        const struct hg_control_flight *f = flight(c, i);
        const uint64_t ns = f->sent_ns ? f->sent_ns + transfer_ns(c, (double)f->bytes) : 0;
        c->free_ns = c->free_ns > ns ? c->free_ns : ns;
    }
}

// How long an empty message would have taken, at least as far as this frame can tell.
static uint64_t measure_rtt(const struct hg_control_flight *f, const struct hg_control_delivery *d)
{
    const uint64_t took_ns = d->at_ns - f->sent_ns;
    const uint64_t span_ns =
        d->begun_ns && d->received_ns > d->begun_ns ? d->received_ns - d->begun_ns : 0;
    const uint64_t alone_ns = span_ns < took_ns ? took_ns - span_ns : took_ns;
    return d->rtt_ns && d->rtt_ns < alone_ns ? d->rtt_ns : alone_ns;
}

void hg_control_delivered(struct hg_control *c, const struct hg_control_delivery *d)
{
    struct hg_control_flight newest = {0};
    c->informed = true;
    // A picture may be sent twice under its number, with loss and without.
    while (c->count && flight(c, 0)->number <= d->number && newest.number < d->number) {
        newest = *flight(c, 0);
        drop_first(c);
        c->delivered++;
    }
    if (!newest.sent_ns || d->at_ns <= newest.sent_ns)
        return;
    note_least(&c->rtt, measure_rtt(&newest, d), d->at_ns);
    note_rate(c, measure_rate(c, &newest, d));
    note(&c->delay_ns, (double)(d->at_ns - newest.begin_ns));
    note_free(c, d->at_ns);
    c->acked_ns = d->at_ns;
    c->holds = false;
}

void hg_control_set_encoding(struct hg_control *c, uint32_t encoding)
{
    if (encoding == c->encoding)
        return;
    c->encoding = encoding;
    hg_control_forget_encoder(c);
}

void hg_control_forget_encoder(struct hg_control *c)
{
    c->encoded = 0;
    c->usual_bytes = c->encode_ns = 0;
}

bool hg_control_is_narrow(const struct hg_control *c, float fps)
{
    return c->informed && c->rate > 0 && c->encoded >= SLOW_FRAMES &&
           c->usual_bytes * share_of(POOR_QUALITY) * (double)fps > c->rate * SHARE;
}

bool hg_control_encoder_is_slow(const struct hg_control *c, float fps)
{
    return fps > 0 && c->encoded >= SLOW_FRAMES && c->encode_ns > SLOW * 1e9 / (double)fps;
}

// ---- decisions ----------------------------------------------------------------------------------

static bool is_overdue(const struct hg_control_flight *f, uint64_t now_ns)
{
    if (!f->sent_ns || !f->expected_ns)
        return false;
    const uint64_t span_ns = f->expected_ns - f->sent_ns;
    return now_ns > f->expected_ns + PATIENCE_NS + span_ns / 4;
}

uint64_t hg_control_due_ns(struct hg_control *c, uint64_t now_ns)
{
    if (!c->informed || !c->count)
        return 0;
    const uint32_t most = c->rate > 0 ? HG_CONTROL_FLIGHTS : FIRST_FLIGHTS;
    if (c->count >= most || is_overdue(flight(c, 0), now_ns)) {
        c->held += !c->holds;
        c->holds = true;
        return UINT64_MAX;
    }
    return c->free_ns > (uint64_t)c->work_ns ? c->free_ns - (uint64_t)c->work_ns : 0;
}

static uint8_t choose_quality(const struct hg_control *c, const struct hg_control_goal *goal)
{
    const double wire = c->rate / (double)goal->fps;
    if (!c->informed || !(c->rate > 0) || !(c->usual_bytes > 0))
        return goal->quality;
    uint8_t best =
        HG_CONTROL_LEAST_QUALITY < goal->quality ? HG_CONTROL_LEAST_QUALITY : goal->quality;
    for (uint8_t q = best; q <= goal->quality; q++) {
        const double bytes = c->usual_bytes * share_of(q);
        if (bytes > wire * (q > c->now.quality ? ROOM : SHARE))
            break;
        best = q;
    }
    return best;
}

struct hg_control_choice hg_control_choose(struct hg_control *c, const struct hg_control_goal *goal)
{
    struct hg_control_choice choice = {.quality = goal->quality, .bitrate = goal->bitrate};
    if (goal->fps > 0) {
        const float sharing = goal->sharing > 1 ? (float)goal->sharing : 1.0f;
        choice.quality = choose_quality(c, goal);
        choice.target_ms = 1000.0f / goal->fps / sharing - (float)(c->read_ns * 1e-6);
        choice.target_ms = fmaxf(choice.target_ms, LEAST_MS);
    }
    if (c->informed && c->rate > 0 && goal->fps > 0) {
        const double bits = fmin(c->rate * 8 * SHARE, 1e9);
        choice.bitrate = goal->bitrate && goal->bitrate < bits ? goal->bitrate : (uint32_t)bits;
    }
    c->now = choice;
    return choice;
}
