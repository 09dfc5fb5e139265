// The worked example of docs/protocol.md: a session byte by byte, made with the codec itself.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/sha256.h"
#include "protocol/gen/gen.h"

struct teller {
    struct hg_writer *out;
    char side; // 'C' or 'S'
    uint32_t request;
};

static void print_bytes(struct hg_writer *out, const uint8_t *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        gen_print(out, "%s%02x",
            i == 0        ? ""
            : i % 16 == 0 ? "\n                        "
                          : " ",
            data[i]);
}

static void print_row(struct hg_writer *out, const char *name, const struct hg_writer *bytes)
{
    gen_print(out, "     %-18s ", name);
    print_bytes(out, bytes->data, bytes->size);
    gen_print(out, "\n");
}

// A field is printed by encoding a layout that holds nothing else.
static void print_field(struct hg_writer *out, const struct hgp_field *field, const void *message)
{
    struct hgp_field alone = *field;
    alone.presence = HGP_P_REQ;
    struct hgp_layout layout = {"", &alone, 1, 0};
    struct hg_writer bytes = {0};
    if (hgp_layout_encode(&layout, HGP_VERSION_MAX, &bytes, message, NULL))
        abort();
    print_row(out, field->name, &bytes);
    hg_writer_finish(&bytes);
}

static uint32_t bitmap_of(const struct hgp_layout *layout, unsigned bitmap, const void *message)
{
    uint32_t bits = 0;
    unsigned optional = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence != HGP_P_OPT)
            continue;
        if (optional / HGP_BITMAP_FIELDS == bitmap &&
            *(const bool *)((const char *)message + field->has_offset))
            bits |= 1u << optional % HGP_BITMAP_FIELDS;
        optional++;
    }
    return bits;
}

static void print_bitmap(struct hg_writer *out, const char *name, uint32_t bits)
{
    struct hg_writer bytes = {0};
    hg_write_u32(&bytes, bits);
    print_row(out, name, &bytes);
    hg_writer_finish(&bytes);
}

static void tell(const struct teller *t, enum hgp_type type, const void *message)
{
    struct hg_writer bytes = {0};
    unsigned optional = 0;
    const struct hgp_layout *layout = hgp_layout_find((uint16_t)type);
    if (hgp_encode(
            &bytes, HGP_VERSION_MAX, (struct hgp_envelope){type, t->request, 0}, message, NULL))
        abort();
    gen_print(t->out, "%c>  %s: %zu bytes of payload, request %u\n     %-18s ", t->side,
        layout->name, bytes.size - HGP_HEADER_BYTES, t->request, "(header)");
    print_bytes(t->out, bytes.data, HGP_HEADER_BYTES);
    gen_print(t->out, "\n");
    if (hgp_layout_known_bits(layout, 0, HGP_VERSION_MAX))
        print_bitmap(t->out, "(bitmap)", bitmap_of(layout, 0, message));
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        const bool second = field->presence == HGP_P_OPT && optional++ == HGP_BITMAP_FIELDS;
        if (second && bitmap_of(layout, 1, message) != 0)
            print_bitmap(t->out, "(second bitmap)", bitmap_of(layout, 1, message));
        if (field->presence == HGP_P_REQ ||
            *(const bool *)((const char *)message + field->has_offset))
            print_field(t->out, field, message);
    }
    hg_writer_finish(&bytes);
}

static void tell_opening(struct hg_writer *out)
{
    struct teller client = {out, 'C', 0}, server = {out, 'S', 0};
    gen_print(out, "C>  preface\n     %-18s ", "");
    print_bytes(out, (const uint8_t *)HGP_PREFACE, HGP_PREFACE_BYTES);
    gen_print(out, "\n");
    tell(&client, HGP_T_hello,
        &(struct hgp_hello){
            .version_min = 1, .version_max = 1, .client = hgp_str_make("example/1.0")});
    tell(&server, HGP_T_welcome,
        &(struct hgp_welcome){.version = 1,
            .server = hgp_str_make("heliod/0.1"),
            .session = 7,
            .auth_required = true,
            .max_message_bytes = HGP_LIMIT_OPEN_DEFAULT});
    tell(&client, HGP_T_auth, &(struct hgp_auth){.token = hgp_str_make("secret")});
    tell(&server, HGP_T_auth_ok,
        &(struct hgp_auth_ok){.role = HGP_role_EDIT, .name = hgp_str_make("ann")});
}

static void tell_scene(struct hg_writer *out)
{
    tell(&(struct teller){out, 'C', 1}, HGP_T_scene_open, &(struct hgp_scene_open){0});
    tell(&(struct teller){out, 'S', 1}, HGP_T_scene_opened,
        &(struct hgp_scene_opened){.first_id = 1, .id_count = 1048576});
    tell(&(struct teller){out, 'C', 2}, HGP_T_node_set,
        &(struct hgp_node_set){.node = 1,
            .has_translation = true,
            .translation = {0, 1, 0},
            .has_visible = true,
            .visible = true});
    tell(&(struct teller){out, 'S', 2}, HGP_T_ok, &(struct hgp_ok){.revision = 1});
}

static void tell_frame(struct hg_writer *out)
{
    static const uint8_t pixels[] = {255, 0, 0, 255, 0, 255, 0, 255};
    struct hgp_stage_time stage = {hgp_str_make("shade"), 1500000};
    tell(&(struct teller){out, 'C', 3}, HGP_T_frame_request,
        &(struct hgp_frame_request){
            .view = 1, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8});
    tell(&(struct teller){out, 'S', 3}, HGP_T_error,
        &(struct hgp_error){.code = HG_E_NOTFOUND,
            .what = hgp_str_make("view 1"),
            .where = hgp_str_make("view"),
            .reason = hgp_str_make("no such view")});
    tell(&(struct teller){out, 'C', 4}, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 2, .has_height = true, .height = 1});
    tell(&(struct teller){out, 'S', 4}, HGP_T_ok, &(struct hgp_ok){.revision = 1});
    tell(&(struct teller){out, 'C', 5}, HGP_T_frame_request,
        &(struct hgp_frame_request){
            .view = 1, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8});
    struct hgp_frame frame = {.view = 1,
        .number = 1,
        .scene_revision = 1,
        .width = 2,
        .height = 1,
        .encoding = HGP_encoding_RAW_RGBA8,
        .samples = 32,
        .settled = true,
        .lossless = true,
        .has_hash = true,
        .stages = {&stage, 1},
        .data = {pixels, sizeof pixels}};
    if (hg_sha256(pixels, sizeof pixels, frame.hash))
        abort();
    tell(&(struct teller){out, 'S', 5}, HGP_T_frame, &frame);
}

void gen_transcript(struct hg_writer *out)
{
    gen_print(out, "```\n");
    tell_opening(out);
    tell_scene(out);
    tell_frame(out);
    gen_print(out, "```\n");
}
