#include "tests/wire/sample.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const sample_variant_names[SAMPLE_VARIANTS] = {"full", "bare", "most"};

static void *must(void *ptr)
{
    if (!ptr) {
        fprintf(stderr, "sample: no memory\n");
        abort();
    }
    return ptr;
}

// ---- filling -----------------------------------------------------------------------------------

// FNV-1a, so that a value follows from the names and from nothing else.
static uint64_t hash_names(const char *a, const char *b, uint32_t index)
{
    uint64_t h = 14695981039346656037u;
    for (; *a; a++)
        h = (h ^ (unsigned char)*a) * 1099511628211u;
    for (; *b; b++)
        h = (h ^ (unsigned char)*b) * 1099511628211u;
    h = (h ^ index) * 1099511628211u;
    return h ^ h >> 29;
}

struct filler {
    enum sample_variant variant;
    struct hg_arena *arena;
    uint32_t index; // of the list item
};

static void fill_layout(struct filler *f, const struct hgp_layout *layout, void *out);

static uint64_t pick_unsigned(const struct filler *f, const struct hgp_field *field, uint64_t h)
{
    uint64_t least = field->limit.u.least, most = field->limit.u.most;
    if (f->variant == SAMPLE_BARE)
        return least;
    if (f->variant == SAMPLE_MOST)
        return most;
    return most - least == UINT64_MAX ? h : least + h % (most - least + 1);
}

static double pick_float(const struct filler *f, const struct hgp_field *field, uint64_t h)
{
    double least = field->limit.f.least, most = field->limit.f.most;
    if (f->variant != SAMPLE_FULL)
        return f->variant == SAMPLE_BARE ? least : most;
    double v = (double)(h % 4096) / 8;
    return v >= least && v <= most ? v : least + (most - least) * 0.25;
}

static void fill_text(const struct filler *f, const struct hgp_field *field, void *member)
{
    char text[80];
    int n = snprintf(text, sizeof text, "%s \xc3\xa9 %u", field->name, f->index);
    uint32_t size = f->variant == SAMPLE_BARE ? 0 : (uint32_t)n;
    char *copy = must(hg_arena_strndup(f->arena, text, size));
    if (field->kind == HGP_K_STR)
        *(struct hgp_str *)member = (struct hgp_str){copy, size};
    else
        *(struct hgp_bytes *)member = (struct hgp_bytes){(const uint8_t *)copy, size};
}

static void fill_list(const struct filler *f, const struct hgp_field *field, void *member)
{
    static const uint32_t counts[SAMPLE_VARIANTS] = {2, 0, 1};
    struct hgp_any_list list = {NULL, counts[f->variant]};
    if (list.count > field->limit.list.max_count)
        list.count = field->limit.list.max_count;
    const struct hgp_layout *layout = field->limit.list.items();
    char *items = must(hg_arena_alloc(f->arena, list.count, layout->struct_size));
    for (uint32_t i = 0; i < list.count; i++) {
        struct filler item = {f->variant, f->arena, i + 1};
        fill_layout(&item, layout, items + i * layout->struct_size);
    }
    list.items = items;
    memcpy(member, &list, sizeof list);
}

static void fill_enum(
    const struct filler *f, const struct hgp_field *field, uint64_t h, void *member)
{
    const struct hgp_enum_table *table = field->limit.values;
    size_t row = f->variant == SAMPLE_BARE   ? 0
                 : f->variant == SAMPLE_MOST ? table->count - 1
                                             : h % table->count;
    memcpy(member, &table->values[row].value, sizeof(uint32_t));
}

static void fill_vector(const struct filler *f, size_t count, uint64_t h, float *out)
{
    for (size_t i = 0; i < count; i++)
        out[i] = f->variant == SAMPLE_BARE   ? 0
                 : f->variant == SAMPLE_MOST ? 3.40282347e38f
                                             : (float)((int)(h >> (2 * i) & 255) - 128) / 8;
}

static void fill_field(
    const struct filler *f, const struct hgp_field *field, uint64_t h, void *member)
{
    switch (field->kind) {
    case HGP_K_U8:
        *(uint8_t *)member = (uint8_t)pick_unsigned(f, field, h);
        break;
    case HGP_K_U16:
        *(uint16_t *)member = (uint16_t)pick_unsigned(f, field, h);
        break;
    case HGP_K_U32:
        *(uint32_t *)member = (uint32_t)pick_unsigned(f, field, h);
        break;
    case HGP_K_U64:
        *(uint64_t *)member = pick_unsigned(f, field, h);
        break;
    case HGP_K_I32:
        *(int32_t *)member = (int32_t)(f->variant == SAMPLE_BARE   ? field->limit.i.least
                                       : f->variant == SAMPLE_MOST ? field->limit.i.most
                                                                   : (int64_t)(h % 100));
        break;
    case HGP_K_F32:
        *(float *)member = (float)pick_float(f, field, h);
        break;
    case HGP_K_F64:
        *(double *)member = pick_float(f, field, h);
        break;
    case HGP_K_BOOL:
        *(bool *)member = f->variant == SAMPLE_FULL ? h & 1 : f->variant == SAMPLE_MOST;
        break;
    case HGP_K_ENUM:
        fill_enum(f, field, h, member);
        break;
    case HGP_K_STR:
    case HGP_K_BYTES:
        fill_text(f, field, member);
        break;
    case HGP_K_HASH:
        for (size_t i = 0; i < 32; i++)
            ((uint8_t *)member)[i] = (uint8_t)((h >> (i % 8 * 8)) + i);
        break;
    case HGP_K_LIST:
        fill_list(f, field, member);
        break;
    default:
        fill_vector(f, hgp_kind_floats(field->kind), h, member);
    }
}

static void fill_layout(struct filler *f, const struct hgp_layout *layout, void *out)
{
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_OPT) {
            bool there = f->variant != SAMPLE_BARE;
            memcpy((char *)out + field->has_offset, &there, sizeof there);
            if (!there)
                continue;
        }
        uint64_t h = hash_names(layout->name, field->name, f->index);
        fill_field(f, field, h, (char *)out + field->offset);
    }
}

void sample_fill(
    const struct hgp_layout *layout, enum sample_variant variant, struct hg_arena *arena, void *out)
{
    memset(out, 0, layout->struct_size);
    struct filler f = {variant, arena, 0};
    fill_layout(&f, layout, out);
}

// ---- text --------------------------------------------------------------------------------------

void sample_text(struct hg_writer *text, const char *fmt, ...)
{
    char line[512];
    va_list args;
    va_start(args, fmt);
    int n = vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    if (n < 0 || n >= (int)sizeof line)
        abort();
    hg_write_bytes(text, line, (size_t)n);
}

void sample_hex(const uint8_t *data, size_t size, struct hg_writer *text)
{
    for (size_t i = 0; i < size; i++)
        sample_text(text, "%02x", data[i]);
}

static void dump_list(const struct hgp_field *field, const void *member, struct hg_writer *text)
{
    struct hgp_any_list list;
    memcpy(&list, member, sizeof list);
    const struct hgp_layout *layout = field->limit.list.items();
    sample_text(text, "[");
    for (uint32_t i = 0; i < list.count; i++) {
        sample_text(text, "%s", i ? "," : "");
        sample_dump(layout, (const char *)list.items + i * layout->struct_size, text);
    }
    sample_text(text, "]");
}

static void dump_enum(const struct hgp_field *field, const void *member, struct hg_writer *text)
{
    uint32_t value;
    memcpy(&value, member, sizeof value);
    sample_text(text, "\"%s\"", hgp_enum_name(field->limit.values->name, value));
}

static void dump_floats(const float *values, size_t count, struct hg_writer *text)
{
    for (size_t i = 0; i < count; i++)
        sample_text(text, "%s%.9g", i ? "," : "[", (double)values[i]);
    sample_text(text, "]");
}

static void dump_quoted_hex(const uint8_t *data, size_t size, struct hg_writer *text)
{
    sample_text(text, "\"");
    sample_hex(data, size, text);
    sample_text(text, "\"");
}

static void dump_field(const struct hgp_field *field, const void *member, struct hg_writer *text)
{
    const struct hgp_str *str = member;
    const struct hgp_bytes *bytes = member;
    switch (field->kind) {
    case HGP_K_U8:
        sample_text(text, "%u", *(const uint8_t *)member);
        break;
    case HGP_K_U16:
        sample_text(text, "%u", *(const uint16_t *)member);
        break;
    case HGP_K_U32:
        sample_text(text, "%u", *(const uint32_t *)member);
        break;
    case HGP_K_U64:
        sample_text(text, "\"%llu\"", (unsigned long long)*(const uint64_t *)member);
        break;
    case HGP_K_I32:
        sample_text(text, "%d", *(const int32_t *)member);
        break;
    case HGP_K_F32:
        sample_text(text, "%.9g", (double)*(const float *)member);
        break;
    case HGP_K_F64:
        sample_text(text, "%.17g", *(const double *)member);
        break;
    case HGP_K_BOOL:
        sample_text(text, *(const bool *)member ? "true" : "false");
        break;
    case HGP_K_ENUM:
        dump_enum(field, member, text);
        break;
    case HGP_K_STR: // samples hold nothing that JSON escapes
        sample_text(text, "\"%.*s\"", (int)str->size, str->data);
        break;
    case HGP_K_BYTES:
        dump_quoted_hex(bytes->data, bytes->size, text);
        break;
    case HGP_K_HASH:
        dump_quoted_hex(member, 32, text);
        break;
    case HGP_K_LIST:
        dump_list(field, member, text);
        break;
    default:
        dump_floats(member, hgp_kind_floats(field->kind), text);
    }
}

void sample_dump(const struct hgp_layout *layout, const void *message, struct hg_writer *text)
{
    const char *comma = "";
    sample_text(text, "{");
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_OPT &&
            !*(const bool *)((const char *)message + field->has_offset))
            continue;
        sample_text(text, "%s\"%s\":", comma, field->name);
        dump_field(field, (const char *)message + field->offset, text);
        comma = ",";
    }
    sample_text(text, "}");
}

// ---- spots -------------------------------------------------------------------------------------

struct walker {
    struct hg_reader r;
    struct sample_spot *spots;
    size_t count, max;
};

static struct sample_spot *add_spot(struct walker *w, const char *prefix, const char *name)
{
    if (w->count == w->max)
        return NULL;
    struct sample_spot *spot = &w->spots[w->count++];
    *spot = (struct sample_spot){.offset = w->r.pos};
    snprintf(spot->path, sizeof spot->path, "%s%s", prefix, name);
    return spot;
}

static size_t fixed_bytes(const struct hgp_field *field)
{
    return field->kind == HGP_K_ENUM ? 2 : field->size; // members are as wide as on the wire
}

static void walk_layout(struct walker *w, const struct hgp_layout *layout, const char *prefix);

static void walk_field(struct walker *w, const struct hgp_field *field, const char *prefix)
{
    struct sample_spot *spot = add_spot(w, prefix, field->name);
    if (!spot)
        return;
    spot->field = field;
    spot->size = 4;
    if (field->kind == HGP_K_LIST) {
        uint32_t count = hg_read_u32(&w->r);
        for (uint32_t i = 0; i < count && !w->r.failed; i++) {
            char path[96];
            snprintf(path, sizeof path, "%s[%u].", spot->path, i);
            walk_layout(w, field->limit.list.items(), path);
        }
    } else if (field->kind == HGP_K_STR || field->kind == HGP_K_BYTES) {
        (void)hg_read_bytes(&w->r, hg_read_u32(&w->r));
    } else {
        spot->size = fixed_bytes(field);
        (void)hg_read_bytes(&w->r, spot->size);
    }
}

// The bits of a bitmap; 0 where there is none.
static uint32_t walk_bitmap(
    struct walker *w, const struct hgp_layout *layout, const char *prefix, unsigned bitmap)
{
    const uint32_t known = hgp_layout_known_bits(layout, bitmap, HGP_VERSION_MAX);
    if (!known || (bitmap > 0 && w->r.pos == w->r.size))
        return 0;
    struct sample_spot *spot = add_spot(w, prefix, "has");
    if (!spot)
        return 0;
    spot->known_bits = known;
    spot->bitmap = bitmap;
    spot->size = 4;
    return hg_read_u32(&w->r);
}

static void walk_layout(struct walker *w, const struct hgp_layout *layout, const char *prefix)
{
    uint32_t bits = walk_bitmap(w, layout, prefix, 0);
    unsigned optional = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_OPT && optional == HGP_BITMAP_FIELDS)
            bits = walk_bitmap(w, layout, prefix, 1);
        if (field->presence == HGP_P_REQ || (bits >> optional % HGP_BITMAP_FIELDS & 1))
            walk_field(w, field, prefix);
        optional += field->presence == HGP_P_OPT;
    }
}

size_t sample_spots(const struct hgp_layout *layout, const uint8_t *payload, size_t size,
    struct sample_spot *spots, size_t max)
{
    struct walker w = {hg_reader_make(payload, size), spots, 0, max};
    walk_layout(&w, layout, "");
    return w.r.failed || w.r.pos != size || w.count == max ? 0 : w.count;
}
