// siege.h - helio bench siege: an honest client of a daemon beside others that attack it, and
// beside others that want the same and behave. Floor 6 (client). siege.c: the daemon and the
// report; siege_load.c: clients, each in a thread.
#ifndef HG_CLIENT_CLI_BENCH_SIEGE_H
#define HG_CLIENT_CLI_BENCH_SIEGE_H

#include <pthread.h>
#include <stdatomic.h>

#include "client/cli/cli.h"

enum { HG_SIEGE_SAMPLES = 65536, HG_SIEGE_CLIENTS = 64 };

// How long something took, again and again.
struct hg_siege_times {
    uint64_t ns[HG_SIEGE_SAMPLES]; // the first ones
    uint32_t count;
};

struct hg_siege_client;

// The loads of clients, which run until they are stopped: attackers send without waiting or
// reading, those that behave want the same and wait for each answer.
struct hg_siege_class {
    const char *name;
    // One round. A failure ends the connection; the client opens another.
    enum hg_status (*attack)(struct hg_siege_client *client, struct hg_error *err);
    enum hg_status (*behave)(struct hg_siege_client *client, struct hg_error *err);
    // Attackers make as many rounds a second as those that behave make in the same run; apart from
    // that, as many as they can.
    bool equal_rate;
    bool own_daemons; // each phase has one: attacks have effects that last
};

extern const struct hg_siege_class hg_siege_classes[];
extern const uint32_t hg_siege_class_count;

struct hg_siege_client {
    const char *url;
    char token[32];
    uint32_t views, side; // side: of each, px
    uint64_t pause_ns;    // between rounds
    uint64_t interval_ns; // from the begin of one round to that of the next; 0 = none is kept
    uint64_t rate, sent;  // of an attack: messages a second at most; and all
    enum hg_status (*round)(struct hg_siege_client *client, struct hg_error *err);
    struct hg_siege_times *times; // of its rounds; NULL: they are counted only
    _Atomic bool measured;        // rounds are timed from now on
    _Atomic bool stop;
    _Atomic uint64_t rounds;
    uint64_t failures;
    struct helio *h;
    struct hgp_scene_opened scene;
    uint64_t seq; // of what it sends
    pthread_t thread;
    struct hg_error err; // the newest failure
};

// Rounds of the honest client: the camera moves, and the frame is awaited; a ping.
enum hg_status hg_siege_frame(struct hg_siege_client *client, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_siege_ping(struct hg_siege_client *client, struct hg_error *err) HG_MUST_CHECK;

// HG_E_LIMIT: no thread.
enum hg_status hg_siege_client_start(struct hg_siege_client *client) HG_MUST_CHECK;
void hg_siege_client_stop(struct hg_siege_client *client); // waits for its end

// The benchmark. *report: freed with hg_free.
enum hg_status hg_cli_siege(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err) HG_MUST_CHECK;

#endif
