// udim.h - sets of image files that make one large image. Floor 2, private to source.c and
// source_rows.c. Any thread.
#ifndef HG_RENDERER_TEXTURE_SOURCE_UDIM_H
#define HG_RENDERER_TEXTURE_SOURCE_UDIM_H

#include "renderer/texture/source/source.h"

enum { HG_UDIM_COLUMNS = 10, HG_UDIM_ROWS = 10 }; // tiles 1001..1100

// Whether a path names a set of tiles ("<UDIM>" in its file's name).
bool hg_udim_is_pattern(const char *path);
// HG_E_NOTFOUND: no tile at all; else what is wrong with a tile.
enum hg_status hg_udim_identify(struct hg_store *store, const char *pattern,
    struct hg_source_info *out, struct hg_error *err) HG_MUST_CHECK;

struct hg_udim_rows; // rows of the grid from the top

enum hg_status hg_udim_rows_open(const char *pattern, const struct hg_source_info *info,
    struct hg_udim_rows **out, struct hg_error *err) HG_MUST_CHECK;
void hg_udim_rows_close(struct hg_udim_rows *rows); // accepts NULL
enum hg_status hg_udim_rows_next(
    struct hg_udim_rows *rows, uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
uint64_t hg_udim_rows_bytes(const struct hg_udim_rows *rows);
// HG_E_HASH: a file was changed since it was identified.
enum hg_status hg_udim_rows_check(
    const struct hg_udim_rows *rows, struct hg_error *err) HG_MUST_CHECK;

// Shared with source.c.
enum hg_status hg_source_stamp(
    const struct hg_image_reader_info *info, uint8_t stamp[HG_SHA256_BYTES]) HG_MUST_CHECK;
enum hg_status hg_source_hash_file(struct hg_store *store, struct hg_image_reader *reader,
    uint8_t hash[HG_SHA256_BYTES], struct hg_error *err) HG_MUST_CHECK;

#endif
