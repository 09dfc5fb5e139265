// open_files.h - files that are read in place: a bounded number of them is open at a time, those
// used longest ago are closed and opened again when they are read. Floor 2, private to the page
// sources. Thread-safe; takes no other lock.
#ifndef HG_RENDERER_TEXTURE_SOURCE_OPEN_FILES_H
#define HG_RENDERER_TEXTURE_SOURCE_OPEN_FILES_H

#include "renderer/image/reader.h"

struct hg_open_files;
struct hg_open_file;

// `most`: files that may stay open while they are not read; 0 = a quarter of the descriptors that
// the process may have, 8 to 1024. HG_E_NOMEM.
enum hg_status hg_open_files_create(uint32_t most, struct hg_open_files **out) HG_MUST_CHECK;
void hg_open_files_destroy(struct hg_open_files *files); // all files removed; accepts NULL
// Closes half of the files that are not being read, when the process is out of descriptors.
void hg_open_files_give_up(struct hg_open_files *files);
// Takes the open reader, also on failure. format: of the texels that hg_open_file_rect gives.
// HG_E_NOMEM.
enum hg_status hg_open_files_add(struct hg_open_files *files, struct hg_image_reader *reader,
    enum hg_pixel_format format, struct hg_open_file **out) HG_MUST_CHECK;
void hg_open_file_remove(struct hg_open_file *file); // no read may be running; accepts NULL

const struct hg_image_reader_info *hg_open_file_info(const struct hg_open_file *file);
enum hg_pixel_format hg_open_file_format(const struct hg_open_file *file);
// As hg_image_reader_rect, opening the file if need be. HG_E_HASH: it is not the same file any
// more. HG_E_NOMEM (also for want of descriptors: try again).
enum hg_status hg_open_file_rect(struct hg_open_file *file, const struct hg_image_rect *rect,
    void *pixels, uint64_t *bytes, struct hg_error *err) HG_MUST_CHECK;
// As hg_image_reader_is_unchanged.
bool hg_open_file_is_unchanged(struct hg_open_file *file);

struct hg_open_files_stats {
    uint32_t open, most; // now; allowed
    uint64_t reopened;
};
void hg_open_files_stats(struct hg_open_files *files, struct hg_open_files_stats *out);

#endif
