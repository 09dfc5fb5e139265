// options.h - heliod's options: one table for command line, file, help and documentation.
// Floor 6 (broker). Thread: the loop. The options own their strings.
#ifndef HG_BROKER_OPTIONS_H
#define HG_BROKER_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "base/status.h"

struct hg_text_list {
    char **items;
    size_t count, capacity;
};

#define HG_OPTION_C_TEXT(member)    char *member; // NULL = none
#define HG_OPTION_C_CHOICE(member)  char *member;
#define HG_OPTION_C_LIST(member)    struct hg_text_list member;
#define HG_OPTION_C_COUNT(member)   uint32_t member;
#define HG_OPTION_C_MIB(member)     uint64_t member##_bytes;
#define HG_OPTION_C_SECONDS(member) uint64_t member##_ns;
#define HG_OPTION_C_BOOL(member)    bool member;

enum hg_options_action {
    HG_OPTIONS_RUN,
    HG_OPTIONS_CHECK,       // --check-config
    HG_OPTIONS_DEVICE_INFO, // --device-info
    HG_OPTIONS_HASH_TOKEN,  // --hash-token
    HG_OPTIONS_HELP,
    HG_OPTIONS_VERSION,
    HG_OPTIONS_DOCS, // --print-docs
};

struct hg_options {
#define HG_OPTION(kind, member, name, metavar, min, max, def, reload, help)                        \
    HG_OPTION_C_##kind(member)
#include "server/broker/options.def"
    enum hg_options_action action;
    char *config; // --config FILE; NULL = none
    char *docs;   // --print-docs FORMAT
};

// Defaults, then the file named by --config, then the flags. argv[0] is the program.
// HG_E_INVAL: err->what is the flag or file, err->where "line N"; HG_E_NOTFOUND, HG_E_IO,
// HG_E_NOMEM.
enum hg_status hg_options_parse(
    int argc, char *const *argv, struct hg_options *out, struct hg_error *err) HG_MUST_CHECK;
void hg_options_finish(struct hg_options *options); // accepts a zeroed object

// Moves the LIVE options of `from` into `into` and finishes `from`. Returns how many START options
// differ; their names, separated by spaces, go to `names` (cut to fit).
size_t hg_options_reload(
    struct hg_options *into, struct hg_options *from, char *names, size_t names_size);

void hg_options_print_help(FILE *file);
void hg_options_print_markdown(FILE *file);
void hg_options_print_man(FILE *file);

#endif
