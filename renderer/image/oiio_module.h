// oiio_module.h - what the loadable module of oiio.cpp gives, and what it needs of the program that
// loads it. Floor 1, private to renderer/image.
//
// OpenImageIO depends on some 250 libraries, which take 0.6 s of processor time to load. Programs
// do without them until they meet a file that needs them: libexec/helio-openimageio.so is loaded by
// the first call of oiio.h, writer.h or texture_system.h (oiio_module.c).
#ifndef HG_RENDERER_IMAGE_OIIO_MODULE_H
#define HG_RENDERER_IMAGE_OIIO_MODULE_H

#include "renderer/image/oiio.h"
#include "renderer/image/texture_system.h"
#include "renderer/image/writer.h"

// Functions of the program that the module calls: it has no copy of base/ with a state of its own.
struct hg_oiio_host {
    __typeof__(hg_error_set) *error_set;
    __typeof__(hg_write_bytes) *write_bytes;
};

// The functions of the three headers, by their names there.
struct hg_oiio_functions {
    __typeof__(hg_oiio_open) *open;
    __typeof__(hg_oiio_close) *close;
    __typeof__(hg_oiio_name) *name;
    __typeof__(hg_oiio_get_header) *get_header;
    __typeof__(hg_oiio_part_header) *part_header;
    __typeof__(hg_oiio_mip_size) *mip_size;
    __typeof__(hg_oiio_read_text) *read_text;
    __typeof__(hg_oiio_read_image) *read_image;
    __typeof__(hg_oiio_read_rows) *read_rows;
    __typeof__(hg_oiio_read_tiles) *read_tiles;
    __typeof__(hg_oiio_encode_image) *encode_image;

    __typeof__(hg_image_writer_begin) *writer_begin;
    __typeof__(hg_image_writer_rows) *writer_rows;
    __typeof__(hg_image_writer_tile) *writer_tile;
    __typeof__(hg_image_writer_next_mip) *writer_next_mip;
    __typeof__(hg_image_writer_end) *writer_end;
    __typeof__(hg_image_writer_abort) *writer_abort;

    __typeof__(hg_texture_system_create) *textures_create;
    __typeof__(hg_texture_system_destroy) *textures_destroy;
    __typeof__(hg_texture_system_add) *textures_add;
    __typeof__(hg_texture_system_sample) *textures_sample;
    __typeof__(hg_texture_system_decoded_bytes) *textures_decoded_bytes;
    __typeof__(hg_texture_system_version) *textures_version;
};

// The module's only symbol. size_bytes: of the struct that the program knows; NULL: the module is
// of another build.
#define HG_OIIO_ATTACH "hg_oiio_attach"
typedef const struct hg_oiio_functions *hg_oiio_attach_fn(
    const struct hg_oiio_host *host, size_t size_bytes);

#endif
