// bench_stream.h - helio bench stream: what pictures of a moving camera cost in each encoding.
// Floor 6 (client).
#ifndef HG_CLIENT_CLI_BENCH_BENCH_STREAM_H
#define HG_CLIENT_CLI_BENCH_BENCH_STREAM_H

#include "client/cli/cli.h"

// In a private worker. The camera goes once around the scene; every encoding gets the same
// pictures. Then nodes that the scene's camera sees are hidden one at a time, and shown again.
// *report: freed with hg_free.
enum hg_status hg_cli_bench_stream(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err) HG_MUST_CHECK;

#endif
