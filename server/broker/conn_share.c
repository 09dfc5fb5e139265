#include "server/broker/conn_share.h"

#include <string.h>

#include "server/broker/counters.h"

// Those for which much waits share output-total equally by token while more than half of it is
// used, so that nothing more is made for those above their share; above all of it the one for which
// most waits is closed.
enum { MUCH_OUTPUT = 1 << 20 };

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
        it->output_share = is_short && it->out.bytes > MUCH_OUTPUT ? share_of(it, tokens, most) : 0;
    table->was_short = is_short;
    if (total > most)
        hg_count(HG_COUNT_REFUSED_OUTPUT);
    if (total > most)
        hg_conn_kill(largest, "more waits for it than for any other, and for all of them more than "
                              "output-total");
}
