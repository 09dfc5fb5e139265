// check.h - the structure of files whose decoders trust it too much.
// Floor 1, private to renderer/image. Pure; any thread.
#ifndef HG_RENDERER_IMAGE_CHECK_H
#define HG_RENDERER_IMAGE_CHECK_H

#include "base/status.h"

// The chunks of a PNG lie inside the file and end with IEND. The decoder would notice too, but
// without the place, and OpenImageIO 2.4 leaks a string when a PNG ends early.
// HG_E_FORMAT with the byte offset. The first 8 bytes are known to be PNG's.
enum hg_status hg_check_png(
    const uint8_t *data, size_t size, const char *name, struct hg_error *err) HG_MUST_CHECK;

// Dispatches to the check for the format (OpenImageIO's name), if there is one.
enum hg_status hg_check_bytes(const char *format, const uint8_t *data, size_t size,
    const char *name, struct hg_error *err) HG_MUST_CHECK;

// OpenImageIO's name of the format of an image that begins with these bytes; `name` gives a hint.
// HG_E_FORMAT.
enum hg_status hg_image_sniff(const void *data, size_t size, const char *name, const char **format,
    struct hg_error *err) HG_MUST_CHECK;

#endif
