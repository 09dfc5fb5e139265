#include "server/broker/connection/conn_share.h"

#include <string.h>

#include "server/broker/metrics/counters.h"

// Those for which much waits share output-total equally by token while more than half of it is
// used, so that nothing more is made for those above their share; above all of it the one for which
// most waits is closed.
enum { MUCH_OUTPUT = 1 << 20, CLOSED_AT_ONCE = 16 };

static bool shares_token(const struct hg_conn *a, const struct hg_conn *b)
{
    return a->auth.has_token == b->auth.has_token &&
           memcmp(a->auth.hash, b->auth.hash, sizeof a->auth.hash) == 0;
}

static uint64_t share_of(const struct hg_conn *conn, uint32_t tokens, uint64_t total)
{
    uint32_t sharing = 0;
    for (const struct hg_conn *it = conn->table->first; it; it = it->next)
        sharing += it->out.bytes > MUCH_OUTPUT && shares_token(it, conn);
    uint64_t share = total / 2 / (tokens ? tokens : 1) / (sharing ? sharing : 1);
    return share > MUCH_OUTPUT ? share : MUCH_OUTPUT;
}

static uint32_t count_tokens(const struct hg_conn_table *table)
{
    uint32_t count = 0;
    for (const struct hg_conn *it = table->first, *other; it; it = it->next) {
        if (it->out.bytes <= MUCH_OUTPUT)
            continue;
        for (other = table->first; other != it; other = other->next)
            if (other->out.bytes > MUCH_OUTPUT && shares_token(other, it))
                break;
        count += other == it;
    }
    return count;
}

void hg_conn_share_output(struct hg_conn_table *table)
{
    uint64_t total = 0, most = table->options->output_total_bytes;
    struct hg_conn *largest = NULL;
    for (struct hg_conn *it = table->first; it; it = it->next) {
        total += it->out.bytes;
        if (!largest || it->out.bytes > largest->out.bytes)
            largest = it;
    }
    bool is_short = total > most / 2;
    uint32_t tokens = is_short ? count_tokens(table) : 0;
    for (struct hg_conn *it = table->first; it && (is_short || table->was_short); it = it->next)
        it->budget.output_share =
            is_short && it->out.bytes > MUCH_OUTPUT ? share_of(it, tokens, most) : 0;
    table->was_short = is_short;
    if (total > most)
        hg_count(HG_COUNT_REFUSED_OUTPUT);
    if (total > most)
        hg_conn_kill(largest, "more waits for it than for any other, and for all of them more than "
                              "output-total");
}

// ---- messages that arrive -----------------------------------------------------------------------

// A message that was begun has to come, however small the steps; not while it is not read.
static bool is_filled(struct hg_conn *conn, uint64_t now_ns)
{
    const struct hg_options *o = conn->table->options;
    struct hg_conn_budget *budget = &conn->budget;
    if (conn->state != HG_CONN_OPEN || conn->turn.paused || hgp_framer_is_empty(&conn->in)) {
        budget->fill_ns = 0;
        return true;
    }
    const uint64_t took_ns = now_ns - budget->fill_ns;
    if (budget->fill_ns && took_ns <= o->peer_timeout_ns)
        return true;
    const double least = (double)took_ns * 1e-9 * o->min_fill * 1024;
    const bool ok =
        !budget->fill_ns || (double)(conn->in.total_bytes - budget->filled_before) >= least;
    budget->fill_ns = now_ns;
    budget->filled_before = conn->in.total_bytes;
    return ok;
}

void hg_conn_check_input(struct hg_conn_table *table)
{
    for (struct hg_conn *it = table->first, *next; it; it = next) {
        next = it->next;
        if (is_filled(it, table->loop->now_ns))
            continue;
        hg_count(HG_COUNT_REFUSED_MIN_FILL);
        hg_conn_kill(it, "sends too little of a message that it has begun (min-fill)");
    }
}

static struct hg_conn *first_of_token(const struct hg_conn *conn)
{
    struct hg_conn *it = conn->table->first;
    while (it != conn && !shares_token(it, conn))
        it = it->next;
    return it;
}

// The first connection of the token of whose messages most has come, with how much that is.
static struct hg_conn *count_input(struct hg_conn_table *table)
{
    struct hg_conn *most = table->first;
    for (struct hg_conn *it = table->first; it; it = it->next)
        it->budget.input = 0;
    for (struct hg_conn *it = table->first; it; it = it->next) {
        if (!it->in.partial)
            continue;
        struct hg_conn *first = first_of_token(it);
        first->budget.input += it->in.filled;
        if (first->budget.input > most->budget.input)
            most = first;
    }
    return most;
}

static struct hg_conn *largest_input(struct hg_conn *first)
{
    struct hg_conn *largest = NULL;
    for (struct hg_conn *it = first; it; it = it->next)
        if (it->in.partial && shares_token(it, first) &&
            (!largest || it->in.filled > largest->in.filled))
            largest = it;
    return largest;
}

void hg_conn_share_input(struct hg_conn_table *table)
{
    uint64_t total = 0;
    const uint64_t most = table->options->input_total_bytes;
    for (struct hg_conn *it = table->first; it; it = it->next)
        total += it->in.partial ? it->in.filled : 0;
    for (int i = 0; i < CLOSED_AT_ONCE && total > most; i++) {
        struct hg_conn *largest = largest_input(count_input(table));
        if (!largest)
            return;
        total -= largest->in.filled;
        hg_count(HG_COUNT_REFUSED_INPUT);
        hg_conn_kill(largest, "more of a message has come of it than of any other with the token "
                              "of which most has, and of all of them more than input-total");
    }
}
