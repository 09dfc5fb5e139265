#include "server/broker/slots.h"

#include "base/clock.h"

// Xorshift (Marsaglia 2003), from 0 to 1.
static double draw(struct hg_conn_table *table)
{
    uint64_t x = table->random ? table->random : hg_clock_now_ns() | 1;
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    table->random = x;
    return (double)(x >> 11) * 0x1p-53;
}

// From half of max-handshakes on newcomers are refused at random, with a probability that rises to
// 1 there: who floods cannot keep all others out, as they could with a plain limit.
static bool is_dropped_early(struct hg_conn_table *table)
{
    double most = table->options->max_handshakes, from = most / 2;
    double excess = ((double)table->opening_count - 1 - from) / (most - from);
    return excess > 0 && draw(table) < excess;
}

enum hg_status hg_slots_take(struct hg_conn *conn)
{
    struct hg_conn_table *table = conn->table;
    conn->place.opening = true;
    table->opening_count++;
    if (hg_conn_is_own(conn))
        return HG_OK;
    conn->place.source = hg_peer_table_join(&table->peers, conn->peer.source);
    if (conn->peer.network[0])
        conn->place.network = hg_peer_table_join(&table->peers, conn->peer.network);
    return conn->place.source && (conn->place.network || !conn->peer.network[0]) ? HG_OK
                                                                                 : HG_E_NOMEM;
}

uint32_t hg_slots_kept(uint32_t most, uint32_t reserved)
{
    return reserved < most / 4 ? reserved : most / 4;
}

const char *hg_slots_refusal(struct hg_conn *conn)
{
    struct hg_conn_table *table = conn->table;
    const struct hg_options *o = table->options;
    uint32_t kept = hg_slots_kept(o->max_connections, o->reserved_connections);
    if (table->count > o->max_connections)
        return "the daemon has as many connections as it takes (max-connections)";
    if (hg_conn_is_own(conn))
        return NULL;
    if (table->count > o->max_connections - kept)
        return "the daemon has as many connections as it takes (max-connections); the last are "
               "kept for its own user (reserved-connections)";
    if (conn->place.source->connections > o->max_per_address)
        return "this address has as many connections as one may have (max-per-address)";
    if (conn->place.network && conn->place.network->connections > o->max_per_network)
        return "this network has as many connections as one may have (max-per-network)";
    if (is_dropped_early(table))
        return "too many connections are opening at this moment (max-handshakes)";
    return NULL;
}

void hg_slots_opened(struct hg_conn *conn)
{
    conn->table->opening_count -= conn->place.opening;
    conn->place.opening = false;
}

void hg_slots_leave(struct hg_conn *conn)
{
    struct hg_conn_table *table = conn->table;
    hg_slots_opened(conn);
    hg_peer_table_leave(&table->peers, conn->place.source, table->loop->now_ns);
    hg_peer_table_leave(&table->peers, conn->place.network, table->loop->now_ns);
    conn->place = (struct hg_conn_place){0};
}
