#include "tests/fuzz/foreign_seeds.h"

#include <stdio.h>
#include <string.h>

static void text(struct hg_writer *w, const char *bytes)
{
    hg_write_bytes(w, bytes, strlen(bytes));
}

// ---- PSD (Adobe Photoshop File Formats Specification, 2019) -------------------------------------

enum { PSD_SIDE = 8, PSD_CHANNELS = 4 };

static void be16(struct hg_writer *w, unsigned value)
{
    hg_write_u8(w, (uint8_t)(value >> 8));
    hg_write_u8(w, (uint8_t)value);
}

static void be32(struct hg_writer *w, uint32_t value)
{
    be16(w, value >> 16);
    be16(w, value & 0xffff);
}

static size_t open_be(struct hg_writer *w)
{
    be32(w, 0);
    return w->size - 4;
}

// The number at `at` is what has been written since.
static void close_be(struct hg_writer *w, size_t at)
{
    hg_write_patch_u32(w, at, __builtin_bswap32((uint32_t)(w->size - at - 4)));
}

// PackBits: sizes of the rows, then each as a repeated byte and copied ones.
static void psd_rows(struct hg_writer *w, unsigned channels)
{
    be16(w, 1);
    for (unsigned i = 0; i < channels * PSD_SIDE; i++)
        be16(w, 2 + 5);
    for (unsigned i = 0; i < channels * PSD_SIDE; i++) {
        hg_write_u8(w, (uint8_t)(1 - 4)); // four of them
        hg_write_u8(w, (uint8_t)(i * 7));
        hg_write_u8(w, 4 - 1);
        for (unsigned k = 0; k < 4; k++)
            hg_write_u8(w, (uint8_t)(i * 5 + k * 40));
    }
}

static void psd_layer(struct hg_writer *w)
{
    static const unsigned channels[PSD_CHANNELS] = {0xffff, 0, 1, 2}; // opacity first
    const size_t section = open_be(w), layers = open_be(w);
    be16(w, 1);
    be32(w, 0);
    be32(w, 0);
    be32(w, PSD_SIDE);
    be32(w, PSD_SIDE);
    be16(w, PSD_CHANNELS);
    for (int i = 0; i < PSD_CHANNELS; i++) {
        be16(w, channels[i]);
        be32(w, 2 + PSD_SIDE * (2 + 2 + 5));
    }
    text(w, "8BIMnorm");
    be32(w, 0xff000000); // opacity, clipping, flags, filler
    const size_t extra = open_be(w);
    be32(w, 0); // mask
    be32(w, 0); // blending ranges
    text(w, "\3lay");
    close_be(w, extra);
    for (int i = 0; i < PSD_CHANNELS; i++)
        psd_rows(w, 1);
    if ((w->size - layers) % 2)
        hg_write_u8(w, 0);
    close_be(w, layers);
    be32(w, 0); // global mask
    close_be(w, section);
}

static void write_psd(struct hg_writer *w)
{
    text(w, "8BPS");
    be16(w, 1);
    hg_write_bytes(w, "\0\0\0\0\0", 6);
    be16(w, PSD_CHANNELS);
    be32(w, PSD_SIDE);
    be32(w, PSD_SIDE);
    be16(w, 8);
    be16(w, 3); // RGB
    be32(w, 0); // no palette
    const size_t resources = open_be(w);
    text(w, "8BIM");
    be16(w, 1005); // resolution
    be16(w, 0);    // without a name
    be32(w, 16);
    for (int i = 0; i < 2; i++) {
        be32(w, 72 << 16);
        be16(w, 1);
        be16(w, 1);
    }
    close_be(w, resources);
    psd_layer(w);
    psd_rows(w, PSD_CHANNELS);
}

// ---- DDS (Microsoft, Programming Guide for DDS) -------------------------------------------------

enum { DDS_SIDE = 8 };

static void dds_head(struct hg_writer *w, uint32_t pitch, uint32_t mips)
{
    text(w, "DDS ");
    hg_write_u32(w, 124);
    hg_write_u32(w, mips ? 0x2100f : 0x81007); // what of it is there
    hg_write_u32(w, DDS_SIDE);
    hg_write_u32(w, DDS_SIDE);
    hg_write_u32(w, pitch);
    hg_write_u32(w, 0);
    hg_write_u32(w, mips);
    for (int i = 0; i < 11; i++)
        hg_write_u32(w, 0);
    hg_write_u32(w, 32);
}

static void dds_tail(struct hg_writer *w, bool mips)
{
    hg_write_u32(w, mips ? 0x401008 : 0x1000);
    for (int i = 0; i < 4; i++)
        hg_write_u32(w, 0);
}

static void write_dds(struct hg_writer *w)
{
    dds_head(w, DDS_SIDE * DDS_SIDE, 0);
    hg_write_u32(w, 4);
    text(w, "DXT5");
    for (int i = 0; i < 5; i++)
        hg_write_u32(w, 0);
    dds_tail(w, false);
    for (uint32_t i = 0; i < DDS_SIDE * DDS_SIDE / 4; i++)
        hg_write_u32(w, i * 0x9e3779b9u);
}

static void write_plain_dds(struct hg_writer *w)
{
    static const uint32_t masks[4] = {0xff0000, 0xff00, 0xff, 0xff000000};
    dds_head(w, DDS_SIDE * 4, 4);
    hg_write_u32(w, 0x41); // RGB and opacity
    hg_write_u32(w, 0);
    hg_write_u32(w, 32);
    for (int i = 0; i < 4; i++)
        hg_write_u32(w, masks[i]);
    dds_tail(w, true);
    for (uint32_t side = DDS_SIDE; side; side /= 2)
        for (uint32_t i = 0; i < side * side; i++)
            hg_write_u32(w, i * 0x01020304u + side);
}

// ---- FBX, binary, version 7.4 (as of Blender's FBX binary file format specification) ------------

// Begins a record; properties follow. Returns where it is.
static size_t open_record(struct hg_writer *w, const char *name, uint32_t properties)
{
    const size_t at = w->size;
    hg_write_u32(w, 0);
    hg_write_u32(w, properties);
    hg_write_u32(w, 0);
    hg_write_u8(w, (uint8_t)strlen(name));
    text(w, name);
    return at;
}

static void end_properties(struct hg_writer *w, size_t at)
{
    hg_write_patch_u32(w, at + 8, (uint32_t)(w->size - at - 13 - w->data[at + 12]));
}

// With records inside: a null record ends them.
static void close_record(struct hg_writer *w, size_t at, bool nested)
{
    static const uint8_t null[13];
    if (nested)
        hg_write_bytes(w, null, sizeof null);
    hg_write_patch_u32(w, at, (uint32_t)w->size);
}

static void put_string(struct hg_writer *w, const char *bytes, size_t size)
{
    hg_write_u8(w, 'S');
    hg_write_u32(w, (uint32_t)size);
    hg_write_bytes(w, bytes, size);
}

static void put_int(struct hg_writer *w, uint32_t value)
{
    hg_write_u8(w, 'I');
    hg_write_u32(w, value);
}

static void put_long(struct hg_writer *w, uint64_t value)
{
    hg_write_u8(w, 'L');
    hg_write_u64(w, value);
}

static void int_record(struct hg_writer *w, const char *name, uint32_t value)
{
    const size_t at = open_record(w, name, 1);
    put_int(w, value);
    end_properties(w, at);
    close_record(w, at, false);
}

static void vertices(struct hg_writer *w)
{
    const size_t at = open_record(w, "Vertices", 1);
    hg_write_u8(w, 'd');
    hg_write_u32(w, 12);
    hg_write_u32(w, 0);
    hg_write_u32(w, 12 * 8);
    for (int i = 0; i < 12; i++)
        hg_write_f64(w, (double)(i * 7 % 5));
    end_properties(w, at);
    close_record(w, at, false);
}

// As zlib has it, in one stored block.
static void corners(struct hg_writer *w)
{
    static const uint32_t indices[] = {0, 1, ~2u, 0, 2, ~3u};
    enum { SIZE = sizeof indices };
    uint32_t sum = 1, sums = 0; // Adler-32
    const size_t at = open_record(w, "PolygonVertexIndex", 1);
    hg_write_u8(w, 'i');
    hg_write_u32(w, 6);
    hg_write_u32(w, 1);
    hg_write_u32(w, 2 + 5 + SIZE + 4);
    hg_write_bytes(w, "\x78\x01\x01", 3);
    hg_write_u16(w, SIZE);
    hg_write_u16(w, (uint16_t)~SIZE);
    for (size_t i = 0; i < SIZE / 4; i++)
        hg_write_u32(w, indices[i]);
    for (size_t i = w->size - SIZE; i < w->size; i++) {
        sum = (sum + w->data[i]) % 65521;
        sums = (sums + sum) % 65521;
    }
    be16(w, sums);
    be16(w, sum);
    end_properties(w, at);
    close_record(w, at, false);
}

static size_t open_object(struct hg_writer *w, const char *kind, uint64_t id)
{
    char name[32];
    const size_t size = (size_t)snprintf(name, sizeof name, "a%c\1%s", 0, kind);
    const size_t at = open_record(w, kind, 3);
    put_long(w, id);
    put_string(w, name, size);
    put_string(w, "Mesh", 4);
    end_properties(w, at);
    return at;
}

static void connection(struct hg_writer *w, uint64_t from, uint64_t to)
{
    const size_t at = open_record(w, "C", 3);
    put_string(w, "OO", 2);
    put_long(w, from);
    put_long(w, to);
    end_properties(w, at);
    close_record(w, at, false);
}

static void write_fbx(struct hg_writer *w)
{
    hg_write_bytes(w, "Kaydara FBX Binary  \0\x1a\0", 23);
    hg_write_u32(w, 7400);
    size_t at = open_record(w, "FBXHeaderExtension", 0);
    int_record(w, "FBXVersion", 7400);
    close_record(w, at, true);
    at = open_record(w, "Objects", 0);
    size_t object = open_object(w, "Geometry", 1000);
    vertices(w);
    corners(w);
    close_record(w, object, true);
    object = open_object(w, "Model", 2000);
    int_record(w, "Version", 232);
    close_record(w, object, true);
    close_record(w, at, true);
    at = open_record(w, "Connections", 0);
    connection(w, 2000, 0);
    connection(w, 1000, 2000);
    close_record(w, at, true);
    static const uint8_t null[13];
    hg_write_bytes(w, null, sizeof null);
}

const struct foreign_seed foreign_seeds[FOREIGN_SEEDS] = {
    {"made.psd", write_psd},
    {"made.dds", write_dds},
    {"plain.dds", write_plain_dds},
    {"binary.fbx", write_fbx},
};
