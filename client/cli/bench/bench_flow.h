// bench_flow.h - benchmarks of streaming: helio bench latency and helio bench many.
// Floor 6 (client).
#ifndef HG_CLIENT_CLI_BENCH_BENCH_FLOW_H
#define HG_CLIENT_CLI_BENCH_BENCH_FLOW_H

#include "client/cli/cli.h"

// Input to photon of one viewer, by stages. *report: freed with hg_free.
enum hg_status hg_cli_bench_latency(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err) HG_MUST_CHECK;
// Viewers of one scene, and tenants: frame rates, fairness, memory. *report: freed with hg_free.
enum hg_status hg_cli_bench_many(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err) HG_MUST_CHECK;

#endif
