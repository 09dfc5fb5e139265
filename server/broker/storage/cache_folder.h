// cache_folder.h - which folder a daemon keeps its cache in: one that no other daemon has.
// Floor 6 (broker). Thread: the loop.
//
// The folder that was asked for, where it is free. Several daemons with the same one, such as two
// `helio serve` of a user, have each their own: CACHE, CACHE/daemons/2, CACHE/daemons/3 and
// so on, the first that is free. One with a state-dir does not start instead: its scenes need the
// uploads in CACHE. Programs without a daemon use CACHE/store and CACHE/shaders, which are made for
// sharing, beside it.
#ifndef HG_BROKER_CACHE_FOLDER_H
#define HG_BROKER_CACHE_FOLDER_H

#include "server/broker/options.h"

struct hg_cache_folder {
    char *asked; // what the options come to; options.cache_dir is the one in use
    int lock_fd; // -1 = not locked
};

// What options and environment name; `options`->cache_dir is set. HG_E_INVAL: there is none.
enum hg_status hg_cache_folder_choose(
    struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
// Makes it and takes it for this process; `options`->cache_dir becomes the one that is used. One
// that was inherited stays locked. HG_E_BUSY: another daemon has it; HG_E_PERM, HG_E_NOSPACE,
// HG_E_IO, HG_E_NOMEM.
enum hg_status hg_cache_folder_open(
    struct hg_cache_folder *folder, struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
// The program before used that folder, so this one does, whatever the options say now: workers are
// in it. False: no memory.
bool hg_cache_folder_inherit(struct hg_cache_folder *folder, struct hg_options *options,
    const char *used, int lock_fd) HG_MUST_CHECK;
// Reloaded options that mean the same folder name it as `in_use` does.
bool hg_cache_folder_compare(const struct hg_cache_folder *folder, const struct hg_options *in_use,
    struct hg_options *reloaded) HG_MUST_CHECK;
void hg_cache_folder_keep_open(const struct hg_cache_folder *folder); // over an exec
void hg_cache_folder_close(struct hg_cache_folder *folder);

#endif
